"""The axis test compares the torque of a joint that lifts the arm with the weight in `cad`."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from config.robot.robot import RobotDescription
from rid_daq.commissioning.axis_motion import AxisMotion
from rid_daq.commissioning.axis_torque import wrong_torque
from rid_daq.commissioning.axis_verdict import AxisVerdict, ObservedMotion

WEIGHT_NM = 20.0 * 9.81 * 0.5
FRICTION_NM = 30.0
LIMIT_NM = 400.0


def pendulum(*, drawn: bool = True, **changes: object) -> RobotDescription:
    """Return a robot with one joint, whose positive motion lifts a horizontal bar of 20 kg.

    If not `drawn`, the robot has no CAD data.
    """
    limits = {"position_min": -1.0, "position_max": 1.0, "velocity": 1.0, "acceleration": 5.0}
    robot: dict[str, object] = {
        "name": "bar",
        "kinematics": {"convention": "modified_dh", "rows": [{"alpha_rad": np.pi / 2.0}]},
        "joints": [{"name": "one", "limits": {**limits, "torque": LIMIT_NM}}],
    }
    if drawn:
        robot["cad"] = [{"mass_kg": 20.0, "centre_m": [0.5, 0.0, 0.0]}]
    return RobotDescription.model_validate_json(json.dumps(robot | changes))


def lifting(torque_nm: float, *, speed: float = 0.02) -> NDArray[Any]:
    """Return rows of a slow motion with a torque [N m]; at rest before and after it is 40 %."""
    kind = [(name, "f8", (1,)) for name in ("position", "target_velocity", "torque_nm")]
    rows = np.zeros(300, np.dtype([*kind, ("valid", "u1", (1,))]))
    rows["valid"] = 1
    rows["target_velocity"][100:200] = speed
    rows["torque_nm"] = 0.4 * torque_nm  # stiction carries part of the weight at rest
    rows["torque_nm"][100:200] = torque_nm
    return rows


@pytest.mark.parametrize("friction_nm", [0.0, FRICTION_NM, 150.0])
def test_weight_and_friction_are_the_torque_of_a_lifting_joint(friction_nm: float) -> None:
    assert wrong_torque(lifting(WEIGHT_NM + friction_nm), pendulum(), 0) == ""


@pytest.mark.parametrize("factor", [0.1, 0.01, 0.001])
def test_a_torque_too_small_to_lift_the_arm_has_a_wrong_unit(factor: float) -> None:
    problem = wrong_torque(lifting(factor * (WEIGHT_NM + FRICTION_NM)), pendulum(), 0)
    assert f"{WEIGHT_NM:.3g} N m" in problem
    assert "rated_torque_units" in problem


def test_a_torque_of_the_opposite_sign_cannot_lift_the_arm() -> None:
    assert "opposite sign" in wrong_torque(lifting(-WEIGHT_NM - FRICTION_NM), pendulum(), 0)


def test_a_torque_beyond_weight_and_possible_friction_has_a_wrong_unit() -> None:
    assert wrong_torque(lifting(10.0 * (WEIGHT_NM + FRICTION_NM)), pendulum(), 0)


@pytest.mark.parametrize("torque_nm", [-60.0, 5.0, 70.0])
def test_a_joint_that_lowers_the_arm_is_not_judged(torque_nm: float) -> None:
    assert wrong_torque(lifting(torque_nm, speed=-0.02), pendulum(), 0) == ""


def test_without_drawings_or_with_little_weight_nothing_is_judged() -> None:
    assert wrong_torque(lifting(1.0), pendulum(drawn=False), 0) == ""
    light = [{"mass_kg": 2.0, "centre_m": [0.5, 0.0, 0.0]}]
    assert wrong_torque(lifting(-1.0), pendulum(cad=light), 0) == ""


def test_the_torque_counts_only_if_the_motion_is_right() -> None:
    motion = AxisMotion("axis2", "°", -2.0, -2.05, -14353, 0.9, 16384.0)
    sound = AxisVerdict(motion, ObservedMotion("axis2", -2.0), ())
    assert sound.with_torque("").passed
    assert sound.with_torque("too small").code == "RID-AXIS-TORQUE"
    reversed_ = AxisVerdict(motion, ObservedMotion("axis2", 2.0), ("it moves back.",))
    assert reversed_.with_torque("too small") == reversed_
