"""`identify` of imported positions with few digits: band, intervals and finding."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import ImportMap
from acquisition.runs.folder import RunFolder
from config.arrays import FloatArray
from config.errors import ConfigError
from config.load import load_robot
from dynamics.model.robot_model import RobotModel, torque
from rid_daq.api.console import SilentConsole
from rid_daq.operations.identify.identified_robot import IdentifiedRobot, identify_robot
from rid_daq.operations.identify.identify import IdentifyRequest
from rid_daq.runs.run_data import RunData
from tests.builders.raised_codes import raises_code

PERIOD_S = 10.0
STEP_S = 0.01
ROBOT = load_robot("ir361").model_copy(update={"spring": None})
MODEL = RobotModel.from_description(ROBOT)
IS_MOTOR = np.array([name.startswith("Im") for name in MODEL.parameter_names])
TRUE = np.random.default_rng(7).uniform(0.5, 1.0, len(MODEL.parameter_names))
TRUE = np.where(IS_MOTOR, 1e-4, 10.0) * TRUE


def rows(step_deg: float, periods: int) -> FloatArray:
    """Return time [s], rounded positions [deg] and torques [N m] with 1 % noise, (rows, 7)."""
    random = np.random.default_rng(1)
    time_s = STEP_S * np.arange(round(periods * PERIOD_S / STEP_S))
    omega = 2.0 * np.pi / PERIOD_S * np.arange(1, 8)
    sine, cosine = 0.2 * random.normal(size=(2, 7, 3))
    s, c = np.sin(np.outer(time_s, omega)), np.cos(np.outer(time_s, omega))
    q, v = s @ sine + c @ cosine, (c * omega) @ sine - (s * omega) @ cosine
    torque_nm = torque(MODEL, q, v, -(s * omega**2) @ sine - (c * omega**2) @ cosine, TRUE)
    torque_nm = torque_nm * (1.0 + 0.01 * random.normal(size=q.shape))
    return np.column_stack([time_s, step_deg * np.round(np.rad2deg(q) / step_deg), torque_nm])


def imported(folder: Path, step_deg: float, periodic: bool) -> RunData:
    """Return the imported data of four periods with rounded positions."""
    np.savetxt(folder / "log.csv", rows(step_deg, 4), delimiter=",", fmt="%.9g")
    layout: dict[str, object] = {
        "name": "rounded",
        "robot": "ir361",
        "columns": 7,
        "time": {"column": 0, "unit": "s"},
        "units": {"position": "deg", "torque": "Nm"},
        "joints": tuple(
            {"joint": name, "position": 1 + j, "torque": 4 + j}
            for j, name in enumerate(ROBOT.joint_names)
        ),
    }
    if periodic:
        layout["period_s"] = PERIOD_S
    recording, report = import_csv(folder / "log.csv", ImportMap.model_validate(layout), ROBOT)
    return RunData.of(RunFolder(folder, "log"), recording, ROBOT, report)


def identified(folder: Path, step_deg: float, periodic: bool, band_hz: float) -> IdentifiedRobot:
    return identified_from(imported(folder, step_deg, periodic), band_hz=band_hz)


def identified_from(*data: RunData, band_hz: float) -> IdentifiedRobot:
    asked = {"names": ["log"], "diagnose": False, "how": {"options": {"band_hz": band_hz}}}
    request = IdentifyRequest.of(asked, shown="identify")
    return identify_robot(request, data, SilentConsole())


@pytest.mark.parametrize("periodic", [True, False])
def test_rounded_positions_narrow_the_band_and_are_reported(tmp_path: Path, periodic: bool) -> None:
    found = identified(tmp_path, 0.5, periodic, 10.0)
    rounded = found.section.rounded_positions
    assert rounded is not None
    assert rounded.steps == pytest.approx(dict.fromkeys(ROBOT.joint_names, np.deg2rad(0.5)))
    assert found.section.band_hz == pytest.approx(rounded.band_hz, abs=0.1)
    assert rounded.band_hz < rounded.asked_hz == 10.0
    estimate = found.estimate
    errors = estimate.values - estimate.base.from_standard(TRUE)
    assert np.mean(np.abs(errors) <= 2.0 * estimate.sigma) >= 0.9


def test_a_stated_band_stays_and_a_better_one_is_advised(tmp_path: Path) -> None:
    rounded = identified(tmp_path, 0.5, False, 8.0).section.rounded_positions
    assert rounded is not None
    assert rounded.band_hz == rounded.asked_hz == 8.0
    assert rounded.advised_hz < 8.0


def test_positions_with_many_digits_are_not_reported(tmp_path: Path) -> None:
    assert identified(tmp_path, 0.001, False, 10.0).section.rounded_positions is None


def test_a_run_of_a_robot_with_more_joints_is_refused(tmp_path: Path) -> None:
    rounded = imported(tmp_path, 0.5, False)
    other = RunData.of(RunFolder(tmp_path, "other"), rounded.recording, load_robot("kr15"), None)
    with raises_code(ConfigError, "RID-ROBOT-OTHER", "kr15", "ir361"):
        identified_from(other, rounded, band_hz=10.0)
