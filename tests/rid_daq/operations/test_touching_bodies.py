"""Body pairs that touch in every pose need no distance; pairs that can separate need one."""

from __future__ import annotations

import numpy as np
import pytest

from config.robot.bodies import Capsule
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription
from dynamics.geometry.clearances import Clearances
from rid_daq.operations.start.touching_bodies import allow_touching_pairs
from tests.builders.raised_codes import raises_invalid

REACH = 0.3


def capsule(link: int, name: str, length: float, radius: float = 0.05) -> Capsule:
    return Capsule(
        kind="capsule",
        link=link,
        name=name,
        start_m=(0.0, 0.0, 0.0),
        end_m=(length, 0.0, 0.0),
        radius_m=radius,
    )


def arm(**more: object) -> RobotDescription:
    """Return a planar arm of three links that can fold onto itself."""
    limits = JointLimits(
        position_min=-3.0, position_max=3.0, velocity=1.0, acceleration=5.0, torque=10.0
    )
    robot = RobotDescription(
        name="plane",
        kinematics=Kinematics(
            convention="modified_dh", rows=tuple(KinematicRow(a_m=REACH) for _ in range(3))
        ),
        joints=tuple(Joint(name=name, limits=limits) for name in ("one", "two", "three")),
        bodies=(
            capsule(0, "base", REACH, radius=0.35),  # its end extends beyond the second axis
            capsule(2, "upper", 0.1),
            capsule(3, "fore", REACH),
        ),
    )
    return RobotDescription.model_validate(robot.model_dump() | more)


def test_only_bodies_that_touch_in_every_pose_are_allowed_to_touch() -> None:
    robot, notes = allow_touching_pairs(arm(), np.zeros(3))
    assert robot.may_touch == (("base", "upper"),)
    assert notes == (
        "these bodies touch, or nearly touch, in nearly all poses, so no distance between them is"
        " required: base and upper (`may_touch` in robot.yaml)",
    )
    assert Clearances.of(arm()).names == (
        "the base's body base and link 2's body upper",
        "the base's body base and link 3's body fore",
    )
    assert Clearances.of(robot).names == ("the base's body base and link 3's body fore",)


def test_a_robot_without_touching_bodies_is_unchanged() -> None:
    apart = arm(bodies=(capsule(0, "base", 0.1), capsule(3, "fore", 0.1)))
    assert allow_touching_pairs(apart, np.zeros(3)) == (apart, ())


@pytest.mark.parametrize("pair", [("base", "base"), ("base", "hand")])
def test_may_touch_requires_the_names_of_two_bodies(pair: tuple[str, str]) -> None:
    with raises_invalid("", "may_touch", "base,"):
        arm(may_touch=(pair,))
