"""Import: several topics of one file are merged.

Velocities that a source leaves empty, or 0 in motion, are ignored and reported.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import ImportMap
from config.errors import DataQualityError
from tests.builders.raised_codes import raises_code

T = 0.01 * np.arange(300)
NAMES = ("position", "velocity", "torque")


def q(t: Any) -> Any:
    return np.sin(3.0 * t)


def tau(t: Any) -> Any:
    return np.cos(5.0 * t)


def layout(**changes: Any) -> ImportMap:
    joint = {"joint": "a", "position": 1, "torque": 2}
    values = {"name": "m", "robot": "r", "columns": 3, "time": {"column": 0}, "joints": [joint]}
    return ImportMap.model_validate_json(json.dumps(values | changes))


def write_merged_topics(
    path: Path, shift_s: float = 0.002, empty: str = "", stop: int = 300
) -> Path:
    """Write positions and torques in separate rows; the torques are `shift_s` later."""
    lines = []
    for row, t in enumerate(T.tolist()):
        lines.append(f"{t!r},{float(q(t))!r},{empty}\n")
        if row < stop:
            lines.append(f"{t + shift_s!r},{empty},{float(tau(t + shift_s))!r}\n")
    path.write_text("".join(lines))
    return path


@pytest.mark.parametrize("empty", ["", " ", "nan", "NaN", "null", "#N/A", "-1.#IND"])
def test_topics_of_one_file_are_interpolated_at_the_rows_of_the_first_joint(
    tmp_path: Path, empty: str
) -> None:
    path = write_merged_topics(tmp_path / "r.csv", empty=empty)
    recording, report = import_csv(path, layout(empty_cells="interpolate"))
    np.testing.assert_array_equal(recording.position[:, 0], q(T))
    np.testing.assert_allclose(recording.torque_nm[1:, 0], tau(T)[1:], atol=4e-4)
    assert (report.rows_read, report.rows_damaged) == (300, 0)
    (note,) = report.findings
    assert re.findall(r"\d+", note) == ["300", "300", "300"]


@pytest.mark.parametrize("empty", ["", "nan", "null"])
def test_merged_topics_without_the_key_are_refused_with_it(tmp_path: Path, empty: str) -> None:
    path = write_merged_topics(tmp_path / "r.csv", empty=empty)
    with raises_code(DataQualityError, "RID-IMPORT-ROWS", "empty_cells: interpolate"):
        import_csv(path, layout())


def test_rows_beyond_the_other_topic_are_removed(tmp_path: Path) -> None:
    path = write_merged_topics(tmp_path / "r.csv", stop=280)
    import_map = layout(empty_cells="interpolate", left_out_limit=0.1)
    recording, report = import_csv(path, import_map)
    assert report.rows_damaged == 20
    assert recording.time_s[-1] == pytest.approx(T[279])
    with raises_code(DataQualityError, "RID-IMPORT-ROWS", "20 ", "--rows"):
        import_csv(path, layout(empty_cells="interpolate"))


def test_without_the_merge_key_the_refusal_names_it(tmp_path: Path) -> None:
    path = write_merged_topics(tmp_path / "r.csv")
    with raises_code(DataQualityError, "RID-IMPORT-ROWS", "empty_cells"):
        import_csv(path, layout())


def test_an_empty_column_is_refused_with_its_name(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("".join(f"{t!r},{float(q(t))!r},\n" for t in T.tolist()))
    with raises_code(DataQualityError, "RID-IMPORT-ROWS", str(path), "torque"):
        import_csv(path, layout(empty_cells="interpolate"))


def test_text_instead_of_a_number_is_not_interpolated(tmp_path: Path) -> None:
    path = write_merged_topics(tmp_path / "r.csv")
    path.write_text(path.read_text().replace("\n", "x\n", 1))
    _, report = import_csv(path, layout(empty_cells="interpolate"))
    assert [(group.first, group.counts) for group in report.damaged] == [
        (1, (("without a number", 1),))
    ]


class TestVelocities:
    JOINT = {"joint": "a", "position": 1, "velocity": 2, "torque": 3}  # noqa: RUF012

    def read(self, path: Path, lacking: int, text: str) -> Any:
        velocity = [text] * lacking + [repr(float(v)) for v in 3.0 * np.cos(3.0 * T[lacking:])]
        path.write_text(
            "".join(
                f"{t!r},{float(q(t))!r},{v},{float(tau(t))!r}\n"
                for t, v in zip(T.tolist(), velocity, strict=True)
            )
        )
        return import_csv(path, layout(columns=4, joints=[self.JOINT]))

    @pytest.mark.parametrize("text", ["nan", ""])
    @pytest.mark.parametrize("lacking", [300, 200])
    def test_velocities_that_a_source_leaves_empty_are_ignored_and_reported(
        self, tmp_path: Path, text: str, lacking: int
    ) -> None:
        recording, report = self.read(tmp_path / "r.csv", lacking, text)
        assert len(recording.time_s) == 300
        assert report.velocity_ratio == (None,)
        (note,) = report.findings
        assert re.findall(r"[\d.]+(?= %)", note) == [f"{lacking / 3:.3g}"]

    @pytest.mark.parametrize("text", ["0", "-0.0", "0.000"])
    def test_velocities_that_are_0_although_the_joint_moves_are_ignored_and_reported(
        self, tmp_path: Path, text: str
    ) -> None:
        recording, report = self.read(tmp_path / "r.csv", 300, text)
        assert len(recording.time_s) == 300
        assert report.velocity_ratio == (None,)
        assert len(report.findings) == 1

    def test_a_joint_at_rest_has_the_velocity_0(self, tmp_path: Path) -> None:
        path = tmp_path / "r.csv"
        path.write_text("".join(f"{t!r},{0.3 + 1e-5 * (t > 1.0)},0,5.0\n" for t in T.tolist()))
        _, report = import_csv(path, layout(columns=4, joints=[self.JOINT]))
        assert not [each for each in report.findings if each.startswith("Velocities")]

    @pytest.mark.parametrize("text", ["nan", ""])
    def test_velocities_missing_in_a_few_rows_are_damage(self, tmp_path: Path, text: str) -> None:
        recording, report = self.read(tmp_path / "r.csv", 3, text)
        assert len(recording.time_s) == 297
        assert report.velocity_ratio[0] == pytest.approx(1.0, abs=1e-2)


class TestDecimalCommasBetweenCommas:
    def lines(self, row: str) -> str:
        numbers = np.column_stack([T, q(T), tau(T)])
        return "".join(row.format(*(f"{x:.12g}".replace(".", ",") for x in r)) for r in numbers)

    def test_quoted_decimal_commas_are_read(self, tmp_path: Path) -> None:
        path = tmp_path / "r.csv"
        path.write_text(self.lines('"{}","{}", "{}"\n'))
        recording, report = import_csv(path, layout(decimal=","))
        assert report.rows_damaged == 0
        np.testing.assert_allclose(recording.torque_nm[:, 0], tau(T), atol=1e-11)

    def test_decimal_commas_without_quotes_are_refused(self, tmp_path: Path) -> None:
        path = tmp_path / "r.csv"
        path.write_text(self.lines("{},{},{}\n"))
        with raises_code(DataQualityError, "RID-IMPORT-ROWS", "quoted"):
            import_csv(path, layout(decimal=","))
