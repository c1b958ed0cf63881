"""Import: an implausible row is reported and removed; an unusable file is refused."""

from __future__ import annotations

import gzip
import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acquisition.imports.read import import_csv
from acquisition.imports.report import DamagedRow, group_damaged
from acquisition.maps.import_map import RowRange
from acquisition.motion.samples import Phase
from acquisition.processing.periods import average_periods
from config.errors import ConfigError, DataQualityError, RidDaqError
from tests.builders.foreign_tables import ROWS, as_lines, sound_table, two_joint_map
from tests.builders.raised_codes import raises_code

Write = Callable[[list[str] | bytes], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write_file(content: list[str] | bytes) -> Path:
        path = tmp_path / "recording.csv"
        data = content if isinstance(content, bytes) else "\n".join([*content, ""]).encode()
        path.write_bytes(data)
        return path

    return write_file


class TestSoundFile:
    def test_a_sound_file_becomes_a_recording_in_si_units_with_its_own_stamps(
        self, write: Write
    ) -> None:
        table = sound_table()
        recording, report = import_csv(write(as_lines(table)), two_joint_map())
        np.testing.assert_allclose(recording.time_s, table[:, 0], atol=1e-6)
        np.testing.assert_allclose(recording.position, table[:, 1:3], atol=1e-6)
        np.testing.assert_allclose(recording.torque_nm[:, 0], 2.0 * table[:, 5], atol=1e-5)
        np.testing.assert_allclose(recording.torque_nm[:, 1], table[:, 6], atol=1e-6)
        assert recording.joint_names == ("a", "b")
        assert recording.source == "import"
        assert recording.sample_period_s is None
        assert (recording.phase == Phase.MAIN).all()
        assert report.rows_used == report.rows_read == ROWS
        assert report.damaged == ()
        assert report.lines()[-1] == "no damaged rows"

    def test_the_report_has_steps_and_agreement_of_velocities(self, write: Write) -> None:
        _, report = import_csv(write(as_lines(sound_table())), two_joint_map())
        assert report.step_min_s == pytest.approx(0.010)
        assert report.step_max_s == pytest.approx(0.012)
        assert report.gaps == 0
        assert report.velocity_ratio == pytest.approx((1.0, 1.0), abs=1e-3)
        assert report.travel == pytest.approx((2.0, 1.0), rel=0.01)

    @pytest.mark.parametrize(
        ("position", "velocity", "factor"),
        [
            ("deg", "deg/s", 180.0 / math.pi),
            ("rev", "rpm", 0.5 / math.pi),
            ("mm", "mm/s", 1e3),
        ],
    )
    def test_a_file_in_other_units_gives_the_same_recording(
        self, write: Write, position: str, velocity: str, factor: float
    ) -> None:
        table = sound_table()
        expected = table[:, 1:3].copy()
        table[:, 1:5] *= factor
        if velocity == "rpm":
            table[:, 3:5] *= 60.0
        table[:, 0] *= 1e3
        table[:, 5] *= 1e3
        units = {"position": position, "velocity": velocity, "current": "mA"}
        import_map = two_joint_map(units=units, time={"column": 0, "unit": "ms"})
        recording, _ = import_csv(write(as_lines(table)), import_map)
        np.testing.assert_allclose(recording.position, expected, atol=1e-5)
        np.testing.assert_allclose(recording.time_s, table[:, 0] / 1e3, atol=1e-8)
        np.testing.assert_allclose(recording.torque_nm[:, 0], 2e-3 * table[:, 5], atol=1e-5)

    def test_a_file_of_motor_side_columns_is_converted_to_the_link_side(self, write: Write) -> None:
        table = sound_table()
        motor = table.copy()
        motor[:, [1, 3]] *= -50.0
        motor[:, 5] /= -50.0
        joints = [joint.model_dump(exclude_none=True) for joint in two_joint_map().joints]
        joints[0]["gear_ratio"] = -50.0
        import_map = two_joint_map(joints=joints)
        recording, _ = import_csv(write(as_lines(motor)), import_map)
        np.testing.assert_allclose(recording.position, table[:, 1:3], atol=1e-6)
        np.testing.assert_allclose(recording.torque_nm[:, 0], 2.0 * table[:, 5], atol=1e-3)

    @pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
    @pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
    def test_a_file_from_a_spreadsheet_is_read_without_editing(
        self, write: Write, newline: str, encoding: str
    ) -> None:
        lines = [line.replace(".", ",") for line in as_lines(sound_table(), ";")]
        header = '"Zeit";"Ä";b;c;d;e;f'
        path = write((newline.join([header, *lines]) + newline * 2).encode(encoding))
        import_map = two_joint_map(delimiter=";", decimal=",", header_rows=1)
        recording, report = import_csv(path, import_map)
        assert report.rows_used == ROWS
        np.testing.assert_allclose(recording.position, sound_table()[:, 1:3], atol=1e-6)

    def test_a_file_is_read_from_the_row_that_the_map_states(self, write: Write) -> None:
        rows = {"first": 101, "last": 300}
        recording, report = import_csv(write(as_lines(sound_table())), two_joint_map(rows=rows))
        assert report.rows_read == 200
        np.testing.assert_allclose(recording.time_s[[0, -1]], sound_table()[[100, 299], 0])

    @pytest.mark.parametrize("rows", [RowRange(first=300, last=401), RowRange(first=401)])
    def test_a_file_without_the_rows_of_the_map_is_refused(
        self, write: Write, rows: RowRange
    ) -> None:
        path = write([*as_lines(sound_table()), "", ""])
        _, report = import_csv(path, two_joint_map(rows={"first": 299, "last": 400}))
        assert report.rows_read == 102
        with raises_code(ConfigError, "RID-IMPORT-RANGE", "400", "401"):
            import_csv(path, two_joint_map(rows=rows.model_dump()))

    def test_a_file_with_a_known_period_can_be_averaged(self, write: Write) -> None:
        lines = as_lines(sound_table(1200))
        recording, _ = import_csv(write(lines), two_joint_map(period_s=2.0))
        average = average_periods(recording)
        assert average.periods_kept == 6
        assert np.sqrt(average.position_variance).max() < 1e-4


class TestDamagedRows:
    def damage(self, write: Write, changes: dict[int, str]) -> tuple[list[str], np.ndarray]:
        """Replace lines (numbered from 1) of a file, import the file, and return the findings and
        the time stamps of the kept rows.
        """
        lines = as_lines(sound_table())
        for row, line in changes.items():
            lines[row - 1] = line
        recording, report = import_csv(write(lines), two_joint_map())
        assert report.rows_used == ROWS - report.rows_damaged
        assert len(recording) == report.rows_used
        return [str(rows) for rows in report.damaged], recording.time_s

    def altered(self, row: int, column: int, value: str) -> str:
        fields = as_lines(sound_table())[row - 1].split(",")
        fields[column] = value
        return ",".join(fields)

    def test_rows_with_another_number_of_columns_are_removed(self, write: Write) -> None:
        found, _ = self.damage(write, {50: "1.0,2.0", 51: "1,2,3,4,5,6,7,8"})
        assert found == [
            "rows 50-51: 2 with a wrong number of columns (row 50: 2 columns instead of 7)"
        ]

    def test_rows_with_another_delimiter_are_reported_with_it(self, write: Write) -> None:
        lines = as_lines(sound_table(), ";")
        names = ("0 of 400", "row 1: 1", "`delimiter: ';'`")
        with raises_code(DataQualityError, "RID-IMPORT-ROWS", *names):
            import_csv(write(lines), two_joint_map())

    def test_rows_with_decimal_commas_are_reported_with_them(self, write: Write) -> None:
        lines = [line.replace(".", ",") for line in as_lines(sound_table(), ";")]
        with raises_code(DataQualityError, "RID-IMPORT-ROWS", "`decimal: ','`"):
            import_csv(write(lines), two_joint_map(delimiter=";"))

    def test_damage_in_many_places_is_reported_by_one_row_of_each_kind(self, write: Write) -> None:
        table = sound_table()
        table[20::7, 1] = 50.0
        lines = as_lines(table)
        lines[25::11] = ["ERR"] * len(lines[25::11])
        with pytest.raises(DataQualityError) as refused:
            import_csv(write(lines), two_joint_map())
        assert re.findall(r"row (\d+)", str(refused.value))[:2] == ["21", "26"]
        assert len(re.findall(r"row \d", str(refused.value))) == 3
        assert len(str(refused.value)) < 500

    def test_rows_with_text_instead_of_a_number_are_removed(self, write: Write) -> None:
        found, _ = self.damage(write, {7: self.altered(7, 2, "ERR")})
        assert found == ["row 7: 1 without a number (row 7: column 2 is 'ERR' (position of b))"]

    @pytest.mark.parametrize("value", ["nan", "inf", "1e250", "-11.0"])
    def test_rows_with_an_implausible_value_are_removed(self, write: Write, value: str) -> None:
        found, _ = self.damage(write, {9: self.altered(9, 1, value)})
        assert len(found) == 1
        assert found[0].startswith("row 9: 1 with an absurd value (row 9: position of a is ")

    @pytest.mark.parametrize("value", ["0.0", "3.5", "9.5", "nan", "1e9", "-1e300"])
    def test_rows_with_a_stamp_out_of_order_are_removed(self, write: Write, value: str) -> None:
        found, stamps = self.damage(write, {200: self.altered(200, 0, value)})
        assert len(found) == 1
        assert found[0].startswith("row 200: 1 with a")
        np.testing.assert_allclose(stamps, np.delete(sound_table()[:, 0], 199), atol=1e-6)

    @pytest.mark.parametrize("row", [1, 200, ROWS])
    def test_rows_with_a_position_jump_are_removed(self, write: Write, row: int) -> None:
        found, stamps = self.damage(write, {row: self.altered(row, 2, "9.000")})
        assert len(found) == 1
        assert (
            f"row {row}: 1 whose position jumps (row {row}: position of b changes by 9." in found[0]
        )
        np.testing.assert_allclose(stamps, np.delete(sound_table()[:, 0], row - 1), atol=1e-6)

    def test_a_last_stamp_far_in_the_future_is_removed(self, write: Write) -> None:
        found, _ = self.damage(write, {ROWS: self.altered(ROWS, 0, "1e6")})
        assert found[0].startswith(f"row {ROWS}: 1 with a time stamp out of order")

    def test_repeated_stamps_cost_one_row_each(self, write: Write) -> None:
        twice = self.altered(60, 0, f"{sound_table()[58, 0]:.6f}")
        found, _ = self.damage(write, {60: twice})
        assert found == ["row 60: 1 with a repeated time stamp (row 60: time stamp is 5.65 s)"]

    def test_of_doubled_stamps_the_row_sampled_then_is_kept(self, write: Write) -> None:
        table = sound_table()
        table[5::50, 0] = table[4::50, 0]
        recording, report = import_csv(write(as_lines(table)), two_joint_map())
        assert report.left_out == {"with a repeated time stamp": 8}
        np.testing.assert_allclose(
            recording.position, np.delete(table, np.s_[5::50], axis=0)[:, 1:3], atol=1e-6
        )

    def test_damage_in_two_places_is_two_ranges(self, write: Write) -> None:
        found, _ = self.damage(write, {20: "x", 21: "y", 300: "z"})
        assert [text.split(":")[0] for text in found] == ["rows 20-21", "row 300"]

    def test_adjacent_damage_of_several_kinds_is_one_range(self) -> None:
        rows = [DamagedRow(4, "a", "x"), DamagedRow(3, "b", "y"), DamagedRow(5, "a", "z")]
        (found,) = group_damaged(rows)
        assert (found.first, found.last, found.count) == (3, 5, 3)
        assert str(found) == "rows 3-5: 1 b (row 3: y), 2 a (row 4: x)"

    def test_damage_in_many_places_is_counted_but_not_listed_completely(self, write: Write) -> None:
        lines = as_lines(sound_table())
        lines[::5] = ["x"] * len(lines[::5])
        _, report = import_csv(write(lines), two_joint_map(left_out_limit=0.2))
        assert len(report.damaged) == report.rows_damaged == 80
        assert report.lines()[3] == ("80 damaged rows left out: 80 with a wrong number of columns")
        assert report.lines()[-1].strip() == "... and 60 more ranges"

    def test_rows_after_a_pause_are_kept(self, write: Write) -> None:
        table = sound_table()
        table[200:, 0] += 60.0
        _, report = import_csv(write(as_lines(table)), two_joint_map())
        assert report.rows_used == ROWS
        assert report.gaps == 1

    @settings(
        max_examples=40,
        suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    )
    @given(data=st.data())
    def test_damaged_rows_of_any_content_never_reach_the_recording(
        self, write: Write, data: st.DataObject
    ) -> None:
        lines = as_lines(sound_table())
        rows = data.draw(st.sets(st.integers(0, ROWS - 1), max_size=40))
        for row in rows:
            text = st.text(st.characters(codec="utf-8", exclude_characters="\r\n"), max_size=60)
            lines[row] = data.draw(text)
        kept = sorted(set(range(ROWS)) - rows)
        recording, _ = import_csv(write(lines), two_joint_map(left_out_limit=0.5))
        np.testing.assert_allclose(recording.time_s, sound_table()[kept, 0], atol=1e-6)
        np.testing.assert_allclose(recording.position, sound_table()[kept, 1:3], atol=1e-6)

    def test_rows_after_a_clock_jitter_are_kept(self, write: Write) -> None:
        table = sound_table()
        table[200, 0] = table[199, 0] + 0.0002
        import_map = two_joint_map(plausible={"speed": 3.2})
        _, report = import_csv(write(as_lines(table)), import_map)
        assert report.rows_used == ROWS
        (found,) = report.findings
        assert "The clock jitters: at 1 places" in found
        assert "row 201: position of" in found
        assert "faster than plausible.speed 3.2" in found

    def test_a_file_with_a_lost_encoder_zero_is_refused(self, write: Write) -> None:
        table = sound_table()
        table[250:, 1] += 0.7
        names = ("250 of 400", "37.5 %", "--rows", "row 251: position", " 0.7")
        with raises_code(DataQualityError, "RID-IMPORT-ROWS", *names):
            import_csv(write(as_lines(table)), two_joint_map())


class TestUnusableFiles:
    def test_a_file_with_more_than_half_its_rows_damaged_is_refused(self, write: Write) -> None:
        lines = as_lines(sound_table())
        lines[: ROWS // 2 + 1] = ["rubbish"] * (ROWS // 2 + 1)
        names = ("199 of 400", "row 1: ", "row 201")
        with raises_code(DataQualityError, "RID-IMPORT-ROWS", *names):
            import_csv(write(lines), two_joint_map())

    def test_a_file_that_is_too_short_is_refused(self, write: Write) -> None:
        with raises_code(DataQualityError, "RID-IMPORT-ROWS", "40", "100"):
            import_csv(write(as_lines(sound_table(40))), two_joint_map())

    def test_a_file_with_velocities_of_another_joint_is_refused(self, write: Write) -> None:
        joints = [joint.model_dump(exclude_none=True) for joint in two_joint_map().joints]
        joints[0]["velocity"], joints[1]["velocity"] = 4, 3
        names = ("a (column 1)", "velocity (column 4)", "2.23", "1.1")
        with raises_code(DataQualityError, "RID-IMPORT-UNITS", *names):
            import_csv(write(as_lines(sound_table())), two_joint_map(joints=joints))

    @pytest.mark.parametrize("content", [b"", b"\n\n\n", b"\x00\xff" * 5000, b"\xff\xfe\x00"])
    def test_a_file_that_is_not_a_recording_is_refused(self, write: Write, content: bytes) -> None:
        with raises_code(DataQualityError, "RID-IMPORT-ROWS", "recording.csv: ", "only 0"):
            import_csv(write(content), two_joint_map())

    @pytest.mark.parametrize(
        "content",
        [
            *(gzip.compress(b"1,2\n"), b"PK\x03\x04workbook", b"SQLite format 3\0"),
            *(b"<!DOCTYPE html>", b"\x93NUMPY\x01", b'{"t": 0.0, "q": [1.0, 2.0]}\n'),
        ],
        ids=["gzip", "xlsx", "bag", "page", "npy", "json lines"],
    )
    def test_a_file_of_another_kind_is_refused_by_its_kind(
        self, write: Write, content: bytes
    ) -> None:
        with raises_code(ConfigError, "RID-IMPORT-FILES"):
            import_csv(write(content), two_joint_map())

    def test_angles_limited_to_one_turn_are_named(self, write: Write) -> None:
        """A broadcaster of a continuous joint publishes angles from -180 to 180 degrees."""
        table = sound_table()
        table[:, 1] = (table[:, 1] + np.pi + 3.0) % (2.0 * np.pi) - np.pi
        with raises_code(DataQualityError, "RID-IMPORT-ROWS", " a jump", "unwrap"):
            import_csv(write(as_lines(table)), two_joint_map())

    def test_a_missing_file_is_an_error(self, tmp_path: Path) -> None:
        with raises_code(ConfigError, "RID-FILE-READ"):
            import_csv(tmp_path / "none.csv", two_joint_map())

    @settings(
        max_examples=60,
        suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    )
    @given(content=st.binary(max_size=2000))
    def test_a_file_of_any_bytes_raises_one_of_our_errors(
        self, write: Write, content: bytes
    ) -> None:
        with pytest.raises(RidDaqError):
            import_csv(write(content), two_joint_map())
