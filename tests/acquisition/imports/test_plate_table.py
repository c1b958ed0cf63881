"""Import of force-plate readings: units, signs, offset, saturation, and refused files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from acquisition.imports.header import number_columns
from acquisition.imports.plate_table import PlateTable, read_plate
from acquisition.maps.import_map import ImportMap
from acquisition.recording.plate_geometry import base_wrench_matrix
from config.cell.plate import CHANNEL_NAMES, PlateDescription
from config.errors import ConfigError, DataQualityError
from tests.builders.raised_codes import raises_code, raises_invalid

STEP_S, ROWS = 0.01, 400
PLACE = {"position_m": [0.1, -0.2, 0.05], "rotation_rad": [0.2, 0.1, 0.7]}
SIZES = {"a_m": 0.12, "b_m": 0.2, "az0_m": -0.05}
CHANNELS = {**PLACE, **SIZES, "channels": list(CHANNEL_NAMES)}
SIX = {**PLACE, "wrench": ["Fx", "Fy", "Fz", "Mx", "My", "Mz"]}
VALUES = 10.0 * np.sin(0.1 * np.arange(ROWS))[:, np.newaxis] + np.arange(1.0, 9.0)


def _map(**plate: object) -> ImportMap:
    layout = {
        "name": "foreign",
        "robot": "ir361",
        "header_rows": 1,
        "time": {"column": "time"},
        "further_files": [{}],
        "joints": [{"joint": "a", "position": "q", "torque": "tau"}],
        "plate": plate,
    }
    return ImportMap.model_validate_json(json.dumps(layout))


def _read(folder: Path, values: np.ndarray, digits: int = 9, /, **plate: object) -> PlateTable:
    robot, file = folder / "robot.csv", folder / "plate.csv"
    robot.write_text("time,q,tau\n0,0,0\n")
    names = plate.get("channels") or plate["wrench"]
    assert isinstance(names, list)
    stamps = np.floor(STEP_S * np.arange(len(values)) * 10**digits + 1e-6) / 10**digits
    rows = np.column_stack([stamps, values[:, : len(names)]])
    lines = [",".join(["time", *names]), *(",".join(map(repr, row)) for row in rows.tolist())]
    file.write_text("\n".join(lines))
    layout = _map(**plate)
    return read_plate((robot, file), number_columns(layout, (robot, file)), 0)


def test_channels_in_newtons_are_read_as_they_are(tmp_path: Path) -> None:
    table = _read(tmp_path, VALUES, **CHANNELS)
    assert np.array_equal(table.readings, VALUES)
    assert (table.gaps, table.findings) == (0, ())
    assert table.valid.all()


def test_a_low_pass_above_half_the_rate_is_reported(tmp_path: Path) -> None:
    found = {
        cutoff_hz: _read(
            tmp_path, VALUES, **CHANNELS, low_pass={"order": 2, "cutoff_hz": cutoff_hz}
        )
        for cutoff_hz in (40.0, 200.0)
    }
    assert found[40.0].findings == ()
    assert ["200 Hz" in finding for finding in found[200.0].findings] == [True]


def test_volts_have_a_factor_for_each_channel_and_a_sign(tmp_path: Path) -> None:
    factors = np.array([-2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0])
    volts = {"unit": "mV", "scale": factors.tolist(), "exerted_on": "robot"}
    table = _read(tmp_path, VALUES, **CHANNELS, **volts)
    assert table.readings == pytest.approx(-1e-3 * factors * VALUES)


def test_newtons_can_have_a_correcting_factor(tmp_path: Path) -> None:
    factors = np.r_[np.ones(7), 1.2]
    table = _read(tmp_path, VALUES, **CHANNELS, scale=factors.tolist())
    assert table.readings == pytest.approx(factors * VALUES)


def test_a_wrench_has_units_of_force_and_moment(tmp_path: Path) -> None:
    table = _read(tmp_path, VALUES, **SIX, unit="kN", moment_unit="Nmm")
    assert table.readings == pytest.approx(VALUES[:, :6] * np.repeat([1e3, 1e-3], 3))


def test_a_wrench_and_its_channels_give_the_same_base_wrench(tmp_path: Path) -> None:
    channels = base_wrench_matrix(PlateDescription.model_validate_json(json.dumps(PLACE | SIZES)))
    at_origin = {"position_m": [0.0, 0.0, 0.0], "rotation_rad": [0.0, 0.0, 0.0]}
    own = base_wrench_matrix(PlateDescription.model_validate_json(json.dumps(at_origin | SIZES)))
    on_plate = -VALUES @ own.T
    table = _read(tmp_path, on_plate, **SIX)
    at_s = table.time_s[10:20]
    assert table.reaction(table.time_s, at_s).base_wrench == pytest.approx(
        VALUES[10:20] @ channels.T
    )


def test_the_offset_at_rest_is_the_mean_of_the_interval(tmp_path: Path) -> None:
    values = VALUES.copy()
    values[:150] = np.arange(8.0)
    rest = _read(tmp_path, values, **CHANNELS, rest_s=[-1.9, -0.6])
    table, offset = rest.without_offset(2.0)
    assert offset == pytest.approx(np.arange(8.0))
    assert table.readings[149] == pytest.approx(np.zeros(8))


def test_a_rest_outside_the_rows_is_refused(tmp_path: Path) -> None:
    table = _read(tmp_path, VALUES, **CHANNELS, rest_s=[-9.0, -8.0])
    with raises_code(DataQualityError, "RID-IMPORT-ROWS", "rest_s"):
        table.without_offset(2.0)


def test_a_stated_offset_is_in_the_unit_of_the_columns(tmp_path: Path) -> None:
    offset = np.arange(8.0)
    table = _read(tmp_path, VALUES, **CHANNELS, unit="kN", offset=offset.tolist())
    corrected, found = table.without_offset(0.0)
    assert found == pytest.approx(1e3 * offset)
    assert corrected.readings == pytest.approx(1e3 * (VALUES - offset))


def test_saturated_readings_are_not_valid_and_are_reported(tmp_path: Path) -> None:
    values = VALUES.copy()
    values[100:120, 4] = 100.0
    table = _read(tmp_path, values, **CHANNELS, saturation=[100.0] * 8)
    assert np.flatnonzero(~table.valid[:, 4]).tolist() == list(range(100, 120))
    assert table.saturated_share[4] == pytest.approx(0.05)
    assert "fz1" in table.findings[0]


def test_a_reading_that_stays_at_its_extreme_and_a_dead_one_are_findings(tmp_path: Path) -> None:
    values = VALUES.copy()
    values[100:130, 4] = 100.0
    values[:, 2] = 1.0
    dead, flat = _read(tmp_path, values, **CHANNELS).findings
    assert "fy14" in dead
    assert "fz1" in flat
    assert "30 rows" in flat


def test_missing_rows_are_gaps_around_which_the_plate_is_not_valid(tmp_path: Path) -> None:
    table = _read(tmp_path, VALUES, **CHANNELS)
    kept = np.r_[0:200, 220:400]
    cut = PlateTable(table.plate, table.time_s[kept], VALUES[kept], table.valid[kept], ROWS, ())
    assert cut.gaps == 1
    usable = cut.reaction(cut.time_s, np.arange(0.005, 3.9, STEP_S)).valid
    valid = np.asarray(usable.all(axis=1))
    assert not valid[200:220].any()
    assert valid[50:150].all()


def test_rows_without_time_stamps_have_a_rate(tmp_path: Path) -> None:
    table = _read(tmp_path, VALUES, **CHANNELS, rate_hz=50.0)
    assert table.time_s[:3] == pytest.approx([0.0, 0.02, 0.04])


def test_too_few_rows_are_refused(tmp_path: Path) -> None:
    with raises_code(DataQualityError, "RID-IMPORT-ROWS"):
        _read(tmp_path, VALUES[:50], **CHANNELS)


def test_too_few_increasing_stamps_are_refused_as_such(tmp_path: Path) -> None:
    with raises_code(DataQualityError, "RID-IMPORT-ROWS", "4", "400"):
        _read(tmp_path, VALUES, 0, **CHANNELS)


def test_columns_in_two_files_are_refused(tmp_path: Path) -> None:
    names = [*CHANNEL_NAMES[:7], "q2"]
    robot, file = tmp_path / "robot.csv", tmp_path / "plate.csv"
    robot.write_text("time,q,tau,q2\n0,0,0,0\n")
    file.write_text(f"time,{','.join(CHANNEL_NAMES[:7])}\n" + "0,0,0,0,0,0,0,0\n")
    layout = number_columns(_map(**(CHANNELS | {"channels": names})), (robot, file))
    with raises_code(ConfigError, "RID-IMPORT-HEADER", "force plate"):
        read_plate((robot, file), layout, 0)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"wrench": ["Fx"]}, "wrench"),
        ({"unit": "V"}, "scale"),
        ({"scale": [1.0] * 6}, "scale"),
        ({"offset": [0.0] * 6}, "offset"),
        ({"offset": [0.0] * 8, "rest_s": [0.0, 1.0]}, "rest_s"),
        ({"rest_s": [1.0, 0.0]}, "rest_s"),
        ({"a_m": None}, "a_m"),
        ({"clock": "own", "lag_s": 0.1}, "lag_s"),
    ],
)
def test_a_contradiction_in_the_map_is_refused(changes: dict[str, object], key: str) -> None:
    with raises_invalid("plate", key):
        _map(**(CHANNELS | changes))
