"""Limits of URDFs: valid ones are used, invalid ones replaced by defaults and reported."""

from __future__ import annotations

import numpy as np
import pytest

from config.errors import ConfigError
from config.formats.urdf import UrdfJoint
from config.robot.joint_size import JointSize, joint_sizes
from config.robot.urdf_limits import FoundLimits, LimitDefaults, limits_of_urdf
from tests.builders.raised_codes import raises_code

SIZE = JointSize(reach_m=1.2, weight=100.0)
ZEROS = {"lower": 0.0, "upper": 0.0, "velocity": 0.0, "effort": 0.0}
WHOLE = {"lower": -2.0, "upper": 2.5, "velocity": 2.0, "effort": 50.0}


def joint(kind: str, limits: dict[str, float]) -> UrdfJoint:
    return UrdfJoint("lift", "r:1", kind, "a", "b", np.eye(4), np.eye(3)[2], limits, None)


def limits_of(
    one: UrdfJoint, defaults: LimitDefaults | None = None, size: JointSize = SIZE
) -> FoundLimits:
    return limits_of_urdf([one], [size], defaults or LimitDefaults())[0]


def test_valid_limits_are_used_and_only_the_acceleration_is_reported() -> None:
    whole = limits_of(joint("revolute", WHOLE))
    limits, replaced_limits = whole.limits, whole.replaced
    assert (limits.position_min, limits.position_max, limits.torque) == (-2.0, 2.5, 50.0)
    assert [str(one) for one in replaced_limits] == [
        "acceleration: 10 (default: five times the velocity, per second)"
    ]


@pytest.mark.parametrize(
    ("kind", "limits", "key", "expected", "expected_text"),
    [
        ("revolute", {"effort": 0.0}, "torque", 200.0,
         "torque: 200 (default: the URDF states 0; twice the weight at full reach)"),
        ("revolute", {"effort": 1e9}, "torque", 200.0, "the URDF states 1e+09"),
        ("revolute", {"velocity": 0.0}, "velocity", 2.5,
         "velocity: 2.5 (default: the URDF states 0; 3 m/s at full reach, 1 to 3 rad/s)"),
        ("prismatic", {"velocity": 0.0}, "velocity", 0.5, "the URDF states 0; usual"),
        ("continuous", ZEROS, "position_max", 6.28, "position: ±6.28 (default: the joint has no"),
        ("continuous", {}, "position_max", 2.5, "position: -2 to 2.5 (the URDF states"),
        ("revolute", ZEROS, "position_max", 3.14, "position: ±3.14 ("),
        ("revolute", {"upper": np.inf}, "position_max", 3.14, "3.14 at the unlimited end ("),
        ("revolute", {"upper": np.inf}, "position_min", -2.0, "the URDF states -2 to inf"),
        ("revolute", {"velocity": np.inf}, "velocity", 2.5, "the URDF states inf"),
        ("revolute", {"soft_lower": -1.0, "soft_upper": 1.0}, "position_max", 1.0,
         "position: -1 to 1 (within <safety_controller>)"),
        ("revolute", {"upper": 1e16}, "position_max", 3.14, "the URDF states -2 to 1e+16"),
        ("prismatic", ZEROS, "position_max", 0.3, "position: ±0.3 ("),
        ("revolute", {"lower": -170.0, "upper": 90.0}, "position_max", np.pi / 2,
         "position: -2.96706 to 1.5708 (repaired: the URDF states -170 to 90, read as degrees)"),
        ("prismatic", {"lower": 0.0, "upper": 800.0}, "position_max", 0.8, "read as mm"),
        ("revolute", {"lower": -170.0, "upper": 90.0, "velocity": 45.0}, "velocity", np.pi / 4,
         "velocity: 0.785398 (repaired: the URDF states 45, in the unit of the positions)"),
        ("revolute", {"lower": -170.0, "upper": 90.0, "velocity": 180.0}, "velocity", np.pi,
         "velocity: 3.14159 (repaired: the URDF states 180, in the unit of the positions)"),
    ],
)  # fmt: skip
def test_invalid_limits_are_replaced_and_reported(
    kind: str, limits: dict[str, float], key: str, expected: float, expected_text: str
) -> None:
    one = limits_of(joint(kind, WHOLE | limits))
    assert getattr(one.limits, key) == pytest.approx(expected)
    assert any(expected_text in str(replacement) for replacement in one.replaced)


@pytest.mark.parametrize(
    ("kind", "limits"),
    [
        ("revolute", {"lower": 0.7, "upper": 0.7}),
        ("revolute", {"lower": 0.0, "upper": 0.0}),
        ("revolute", {"lower": 2.0, "upper": -1.0}),
        ("revolute", {"lower": 5.0, "upper": np.inf}),
        ("revolute", {"upper": 5e3}),
        ("revolute", {"velocity": -2.0}),
        ("revolute", {"velocity": 120.0}),
        ("revolute", {"velocity": 1e-6}),
        ("revolute", {"effort": -1.0}),
        ("revolute", {"effort": 1e-4}),
        ("revolute", {"acceleration": -1.0}),
        ("revolute", {"soft_lower": 2.6, "soft_upper": 3.0}),
        ("continuous", {"lower": 1.0, "upper": 1.0}),
        ("prismatic", {"lower": 0.1, "upper": 0.1}),
    ],
)
def test_impossible_limits_are_refused_and_never_widened(
    kind: str, limits: dict[str, float]
) -> None:
    with pytest.raises(ConfigError) as refused:
        limits_of(joint(kind, WHOLE | limits))
    assert refused.value.refusal == "RID-URDF-LIMIT"
    assert str(refused.value).startswith("r:1: ")


@pytest.mark.parametrize(
    ("limits", "expected"),
    [({"lower": -1.5}, (-1.5, 0.0)), ({"upper": 1.5}, (0.0, 1.5))],
)
def test_a_missing_bound_is_zero(limits: dict[str, float], expected: tuple[float, float]) -> None:
    one = limits_of(joint("revolute", {"velocity": 2.0, "effort": 50.0} | limits))
    assert (one.limits.position_min, one.limits.position_max) == expected
    assert any(replacement.key == "position" for replacement in one.replaced)


def test_the_smaller_of_two_stated_accelerations_is_used() -> None:
    one = limits_of(joint("revolute", WHOLE | {"acceleration": 4.0, "deceleration": 3.0}))
    assert one.limits.acceleration == 3.0


def test_zero_limits_that_lock_a_joint_are_replaced_by_a_given_range() -> None:
    locked = joint("revolute", WHOLE | {"lower": 0.0, "upper": 0.0})
    assert limits_of(locked, LimitDefaults(position=(1.0,))).limits.position_max == 1.0


def test_options_replace_missing_limits_only() -> None:
    defaults = LimitDefaults(position=(1.0,), velocity=(1.5,), acceleration=(3.0,), torque=(70.0,))
    bare, whole = (limits_of(joint("revolute", x), defaults).limits for x in ({}, WHOLE))
    assert (bare.position_min, bare.position_max) == (-1.0, 1.0)
    assert (bare.velocity, bare.acceleration, bare.torque) == (1.5, 3.0, 70.0)
    assert (whole.position_max, whole.velocity, whole.torque) == (2.5, 2.0, 50.0)
    with raises_code(ConfigError, "RID-OPTION-COUNT", "--effort"):
        limits_of(joint("revolute", WHOLE), LimitDefaults(torque=(1.0, 2.0)))


def test_dimensions_are_those_of_the_stretched_arm() -> None:
    # Two links of 1 m, 2 and 3 kg, centres in the middle, folded back at zero.
    joints = [joint("revolute", WHOLE), joint("prismatic", WHOLE)]
    origins, centres = np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.array([[0.5, 0, 0], [0.5, 0, 0]])
    first, second = joint_sizes(joints, origins, np.zeros(3), centres, np.array([2.0, 3.0]))
    assert (first.reach_m, second.reach_m) == (2.0, 1.0)
    assert first.weight == pytest.approx(9.81 * (2.0 * 0.5 + 3.0 * 1.5))
    assert second.weight == pytest.approx(9.81 * 3.0)
