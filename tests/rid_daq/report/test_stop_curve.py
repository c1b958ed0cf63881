"""The curve of the joint that caused a stop shows the supervised quantity until the stop."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from acquisition.supervision.stop_reason import StopCode, StopReason
from config.load import LoadedCell, load_cell
from rid_daq.report.sections.stop import StopCurve

PERIOD_S = 0.008
ROWS, STOP = 300, 250


@pytest.fixture(scope="module")
def loaded() -> LoadedCell:
    return load_cell("ir361")


@pytest.fixture
def recording(loaded: LoadedCell) -> Recording:
    """Return two seconds at constant speed with growing error of axis2; at rest after row STOP."""
    joints = len(loaded.robot.joints)
    since_s = PERIOD_S * np.minimum(np.arange(ROWS), STOP)[:, np.newaxis]
    target = np.tile(0.1 * since_s, joints)
    position = target.copy()
    position[:, 1] -= 1e-4 * np.minimum(np.arange(ROWS), STOP)
    target[STOP + 1 :] = position[STOP + 1 :]
    torque = np.tile(np.arange(ROWS, dtype=float)[:, np.newaxis], joints)
    return Recording(
        joint_names=loaded.robot.joint_names,
        time_s=np.asarray(PERIOD_S * np.arange(ROWS), dtype=np.float64),
        position=position,
        torque_nm=torque,
        valid=np.ones(ROWS, dtype=bool),
        phase=np.where(np.arange(ROWS) <= STOP, Phase.MAIN, Phase.HOLD).astype(np.uint8),
        sample_index=np.full(ROWS, -1),
        source="cell",
        target_position=target,
    )


def curve(recording: Recording, loaded: LoadedCell, code: StopCode, **what: Any) -> StopCurve:
    found = StopCurve.of(
        recording, StopReason(code, "stopped", joint="axis2", **what), loaded.config, loaded.robot
    )
    assert found is not None
    return found


def test_the_following_error_ends_with_the_reported_value(
    recording: Recording, loaded: LoadedCell
) -> None:
    drawn = curve(recording, loaded, StopCode.FOLLOWING_ERROR, value=0.025, limit=0.02)
    assert (drawn.joint, drawn.quantity, drawn.unit) == ("axis2", "following error", "rad")
    assert drawn.time_s[-1] == 0.0
    assert drawn.time_s[0] == pytest.approx(-1.0)
    assert drawn.value[-1] == pytest.approx(0.025)
    rules = loaded.config.supervision
    allowed = rules.following_error_min_rad + 0.1 * rules.following_error_per_velocity_s
    np.testing.assert_allclose(drawn.high, allowed, rtol=1e-4)
    np.testing.assert_allclose(drawn.low, -allowed, rtol=1e-4)


@pytest.mark.parametrize(
    ("code", "quantity", "unit", "last"),
    [
        (StopCode.POSITION_LIMIT, "position", "rad", 0.1 * PERIOD_S * STOP - 1e-4 * STOP),
        (StopCode.VELOCITY_LIMIT, "velocity", "rad/s", 0.1 - 1e-4 / PERIOD_S),
        (StopCode.SET_POINT, "velocity of the set-point", "rad/s", 0.1),
        (StopCode.TORQUE_LIMIT, "torque", "N m", STOP),
        (StopCode.DRIVE_FAULT, "torque", "N m", STOP),
    ],
)
def test_each_stop_shows_the_quantity_that_caused_it(
    recording: Recording,
    loaded: LoadedCell,
    code: StopCode,
    quantity: str,
    unit: str,
    last: float,
) -> None:
    drawn = curve(recording, loaded, code)
    assert (drawn.quantity, drawn.unit) == (quantity, unit)
    assert drawn.value[-1] == pytest.approx(last, rel=1e-4)
    assert max(drawn.low) < min(drawn.high)


def test_the_limits_equal_those_of_the_supervision(
    recording: Recording, loaded: LoadedCell
) -> None:
    drawn = curve(recording, loaded, StopCode.TORQUE_LIMIT)
    margin = 1.0 + loaded.config.supervision.limit_margin_fraction
    assert drawn.high[-1] == pytest.approx(loaded.robot.joints[1].limits.torque * margin, rel=1e-4)


def test_a_stop_without_a_joint_has_no_curve(recording: Recording, loaded: LoadedCell) -> None:
    reason = StopReason(StopCode.INTERRUPTED, "stopped by the user or by the end of the program")
    assert StopCurve.of(recording, reason, loaded.config, loaded.robot) is None


def test_a_curve_needs_at_least_two_rows(recording: Recording, loaded: LoadedCell) -> None:
    reason = StopReason(StopCode.TORQUE_LIMIT, "stopped", joint="axis2")
    first = recording.part(slice(0, 1))
    assert StopCurve.of(first, reason, loaded.config, loaded.robot) is None
