"""Import: a sampling rate instead of time stamps, and signals in several files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import ImportMap
from config.errors import ConfigError, DataQualityError
from tests.builders.raised_codes import raises_code

T = 0.01 * np.arange(300)
POSITION = np.sin(3.0 * T)
TORQUE = np.cos(5.0 * T)


def layout(text: str, torque: int = 2) -> ImportMap:
    joint = f'"joints": [{{"joint": "a", "position": 1, "torque": {torque}}}]'
    return ImportMap.model_validate_json(f'{{"name": "m", "robot": "r", {joint}, {text}}}')


def save(path: Path, *columns: np.ndarray) -> Path:
    np.savetxt(path, np.column_stack(columns), fmt="%.12g", delimiter=",")
    return path


def test_rows_with_a_known_rate_need_no_stamps(tmp_path: Path) -> None:
    path = save(tmp_path / "r.csv", T, POSITION, TORQUE)
    lines = path.read_text().splitlines()
    lines[100] = "x"
    path.write_text("\n".join(["header", *lines]))
    import_map = layout('"columns": 3, "rate_hz": 200, "header_rows": 1')
    recording, report = import_csv(path, import_map)
    assert report.rows_damaged == 1
    np.testing.assert_allclose(recording.time_s, np.delete(np.arange(300) / 200.0, 100))


def test_velocities_reveal_a_wrong_rate(tmp_path: Path) -> None:
    velocities = 3.0 * np.cos(3.0 * T), 2.0 * np.cos(2.0 * T)
    path = save(tmp_path / "r.csv", POSITION, np.sin(2.0 * T), *velocities, TORQUE, -TORQUE)
    joints = ", ".join(
        f'{{"joint": "{name}", "position": {n}, "velocity": {n + 2}, "torque": {n + 4}}}'
        for n, name in enumerate("ab")
    )
    values = f'"name": "m", "robot": "r", "columns": 6, "rate_hz": 90, "joints": [{joints}]'
    _, report = import_csv(path, ImportMap.model_validate_json(f"{{{values}}}"))
    (found,) = report.findings
    assert "positions and rate_hz are 0.900 times" in found


@pytest.mark.parametrize("field", ["0_5", "1,5", "nan", "inf", "", "0x1", "1.5 Nm", "٣"])
def test_a_field_that_is_not_a_number_is_a_damaged_row(tmp_path: Path, field: str) -> None:
    path = save(tmp_path / "r.csv", T, POSITION, TORQUE)
    lines = path.read_text().splitlines()
    lines[100] = f"{T[100]:.12g};{POSITION[100]:.12g};{field}".replace(";", ",")
    path.write_text("\n".join(lines))
    recording, report = import_csv(path, layout('"columns": 3, "time": {"column": 0}'))
    assert report.rows_damaged == 1
    assert report.damaged[0].first == 101
    assert len(recording.time_s) == len(T) - 1


@pytest.mark.parametrize(("field", "damaged"), [("0,5", 0), ("1.234,5", 1), ("0.5", 1), ("0_5", 1)])
def test_with_decimal_commas_a_point_as_thousands_separator_is_damage(
    tmp_path: Path, field: str, damaged: int
) -> None:
    path = save(tmp_path / "r.csv", T, POSITION, TORQUE)
    lines = [line.replace(",", ";").replace(".", ",") for line in path.read_text().splitlines()]
    lines[100] = ";".join([*lines[100].split(";")[:2], field])
    path.write_text("\n".join(lines))
    keys = '"columns": 3, "time": {"column": 0}, "decimal": ",", "delimiter": ";"'
    recording, report = import_csv(path, layout(keys))
    assert report.rows_damaged == damaged
    if not damaged:
        assert recording.torque_nm[100, 0] == 0.5


class TestTwoFiles:
    MAP = '"columns": 2, "time": {"column": 0}, "further_files": [{"columns": 2}]'

    def test_two_files_with_the_same_rows_are_one_recording(self, tmp_path: Path) -> None:
        positions = save(tmp_path / "q.csv", T, POSITION)
        torques = save(tmp_path / "tau.csv", T, TORQUE)
        recording, report = import_csv(positions, layout(self.MAP, 3), further=[torques])
        np.testing.assert_allclose(recording.position[:, 0], POSITION, atol=1e-9)
        np.testing.assert_allclose(recording.torque_nm[:, 0], TORQUE, atol=1e-9)
        assert report.findings == ()

    def test_a_second_file_with_other_stamps_is_interpolated_at_those_of_the_first(
        self, tmp_path: Path
    ) -> None:
        torque_times_s = np.arange(0.0, 3.0, 0.002)
        positions = save(tmp_path / "q.csv", T, POSITION)
        torques = save(tmp_path / "tau.csv", np.cos(5.0 * torque_times_s), 1e3 * torque_times_s)
        torques.write_text(torques.read_text().replace("\n", "\nbroken\n", 1))
        further = '"further_files": [{"columns": 2, "time": {"column": 1, "unit": "ms"}}]'
        import_map = layout(f'"columns": 2, "time": {{"column": 0}}, {further}', 2)
        recording, report = import_csv(positions, import_map, further=[torques])
        np.testing.assert_allclose(recording.torque_nm[:, 0], TORQUE, atol=1e-4)
        assert report.findings[0].startswith("tau.csv: 1 of 1501 rows cannot be read")

    def test_two_files_that_do_not_overlap_are_refused(self, tmp_path: Path) -> None:
        positions = save(tmp_path / "q.csv", T, POSITION)
        torques = save(tmp_path / "tau.csv", T + 1.5, TORQUE)
        names = ("150 of 300", "tau.csv", "clocks")
        with raises_code(DataQualityError, "RID-IMPORT-ROWS", *names):
            import_csv(positions, layout(self.MAP, 3), further=[torques])

    def test_two_files_must_both_be_named(self, tmp_path: Path) -> None:
        positions = save(tmp_path / "q.csv", T, POSITION)
        with raises_code(ConfigError, "RID-IMPORT-FILES"):
            import_csv(positions, layout(self.MAP, 3))
