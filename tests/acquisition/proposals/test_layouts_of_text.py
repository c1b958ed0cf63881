"""Proposed import maps: units of the time stamps, rows of units, separators at the ends of rows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import ImportMap
from acquisition.proposals.propose import propose_map
from config.errors import ConfigError
from config.load import load_robot
from tests.acquisition.proposals.test_propose import QD, ROBOT, TAU, Q, T, numbers
from tests.builders.raised_codes import raises_code

NAMES = [*numbers("q{n}"), *numbers("qd{n}"), *numbers("tau{n}")]
TABLE = np.hstack([Q, QD, TAU])


def write(
    path: Path,
    stamps: Sequence[str],
    *,
    time: str = "t",
    head: Sequence[str] = (),
    table: np.ndarray = TABLE,
    ends: tuple[str, str] = ("", ""),
) -> Path:
    """Write a file; `ends` are texts after the names and after each row of numbers."""
    rows = [
        f"{stamp};{';'.join(f'{value:.12g}' for value in row)}{ends[1]}"
        for stamp, row in zip(stamps, table, strict=True)
    ]
    path.write_text("\n".join([f"{time};{';'.join(NAMES)}{ends[0]}", *head, *rows, ""]))
    return path


def seconds(scale: float = 1.0) -> list[str]:
    return [f"{scale * stamp:.12g}" for stamp in T]


def read_with(path: Path, **keys: object) -> np.ndarray:
    """Return time, positions and torques as the proposed map reads them."""
    proposal = propose_map(path, ROBOT)
    import_map = ImportMap.model_validate({**proposal.keys, **keys}, strict=False)
    recording, _ = import_csv(path, import_map, load_robot(ROBOT))
    return np.column_stack(
        [recording.time_s - recording.time_s[0], recording.position, recording.torque_nm]
    )


EXPECTED = np.column_stack([T, Q, TAU])


@pytest.mark.parametrize(
    ("time", "scale", "unit"),
    [
        ("t [min]", 1.0 / 60.0, "min"),
        ("time_ms", 1e3, "ms"),
        ("Time (s)", 1.0, "s"),
        ("timestamp_us", 1e6, "us"),
    ],
)
def test_the_unit_in_the_name_of_the_time_is_used(
    tmp_path: Path, time: str, scale: float, unit: str
) -> None:
    path = write(tmp_path / "log.csv", seconds(scale), time=time)
    assert propose_map(path, ROBOT).keys["time"] == {"column": time, "unit": unit}
    np.testing.assert_allclose(read_with(path), EXPECTED, atol=1e-4)


def test_a_fast_recording_in_ms_is_not_read_as_a_slow_one_in_seconds(tmp_path: Path) -> None:
    """Steps of 0.1 would be usual in seconds, and the file has no velocities that contradict."""
    path = tmp_path / "log.csv"
    rows = [f"{0.1 * k:.4f};{';'.join(f'{v:.9g}' for v in row)}" for k, row in enumerate(TABLE)]
    names = ["t [ms]", *numbers("q{n}"), *numbers("x{n}"), *numbers("tau{n}")]
    path.write_text("\n".join([";".join(names), *rows, ""]))
    assert propose_map(path, ROBOT).keys["time"]["unit"] == "ms"


@pytest.mark.parametrize("unit", ["h", "cycles"])
def test_time_in_an_unknown_unit_is_refused(tmp_path: Path, unit: str) -> None:
    path = write(tmp_path / "log.csv", seconds(), time=f"t [{unit}]")
    with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", f"unit {unit}"):
        propose_map(path, ROBOT)


def test_file_times_of_windows_are_recognised(tmp_path: Path) -> None:
    stamps = [str(132_959_733_843_760_000 + round(1e7 * stamp)) for stamp in T]
    path = write(tmp_path / "log.csv", stamps, time="FullTimeStamp")
    assert propose_map(path, ROBOT).keys["time"]["unit"] == "filetime"
    np.testing.assert_allclose(read_with(path), EXPECTED, atol=1e-4)


@pytest.mark.parametrize("form", ["{}", "[{}]", "({})"])
def test_a_row_of_units_below_the_names_is_used(tmp_path: Path, form: str) -> None:
    units = ["ms", *["deg"] * 3, *["deg/s"] * 3, *["mNm"] * 3]
    table = np.hstack([np.rad2deg(Q), np.rad2deg(QD), 1e3 * TAU])
    head = ";".join(form.format(unit) for unit in units)
    path = write(tmp_path / "log.csv", seconds(1e3), head=[head], table=table)
    keys = propose_map(path, ROBOT).keys
    assert keys["units"] == {"position": "deg", "velocity": "deg/s", "torque": "mNm"}
    np.testing.assert_allclose(read_with(path), EXPECTED, atol=1e-4)


@pytest.mark.parametrize("ends", [(";", ";"), ("", ";"), (";", "")])
def test_separators_at_the_ends_of_rows_are_ignored(tmp_path: Path, ends: tuple[str, str]) -> None:
    path = write(tmp_path / "log.csv", seconds(), ends=ends)
    assert "empty_cells" not in propose_map(path, ROBOT).keys
    np.testing.assert_allclose(read_with(path), EXPECTED, atol=1e-4)


def test_two_columns_of_one_name_are_a_doubt(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", seconds(), ends=(";tau1", ";7.0"))
    doubts = propose_map(path, ROBOT).doubts
    assert any("tau1" in doubt and "column 8" in doubt for doubt in doubts)


def test_time_stamps_that_lost_their_digits_are_refused_by_their_column(tmp_path: Path) -> None:
    """A spreadsheet shows nanoseconds since 1970 as 1.764316800E+18."""
    stamps = [f"{1e9 * (1_764_316_800 + stamp):.9e}" for stamp in T]
    path = write(tmp_path / "log.csv", stamps, time="stamp")
    with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", "Column stamp "):
        propose_map(path, ROBOT)


def test_a_velocity_of_the_wrong_sign_does_not_turn_radians_into_degrees(tmp_path: Path) -> None:
    """In a smaller unit the joint would be at rest, so that nothing contradicts its velocity."""
    wrong = TABLE.copy()
    wrong[:, Q.shape[1] + 1] *= -1.0
    proposal = propose_map(write(tmp_path / "log.csv", seconds(), table=wrong), ROBOT)
    assert proposal.report is None
    assert proposal.keys["units"]["position"] == "rad"
    assert any("RID-IMPORT-UNITS" in doubt and "axis2" in doubt for doubt in proposal.doubts)


def test_positions_of_motors_need_a_map_that_says_so(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", seconds())
    head, *lines = path.read_text().split("\n")
    path.write_text("\n".join([head.replace("q", "motor_position_"), *lines]))
    with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", "side: motor"):
        propose_map(path, ROBOT)
