"""Motions for friction within the limits and workspace of a robot."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from config.errors import ConfigError
from config.load import load_robot
from config.robot.bodies import Capsule, Plane, Workspace
from dynamics.geometry.kinematics import Chain, forward
from identification.friction.motions import constant_velocity_motion, reversed_motion
from tests.builders.raised_codes import raises_code

CYCLE_S = 0.008


@pytest.mark.parametrize("name", ["ir361", "ur10e"])
def test_every_joint_has_slow_and_fast_runs_within_its_limits(name: str) -> None:
    robot = load_robot(name)
    motion = constant_velocity_motion(robot, speeds=6, repeats=2)
    samples = motion.plan(robot, CYCLE_S)
    _, runs = motion.runs(robot, CYCLE_S)
    assert len(runs) == len(robot.joints) * 6 * 4
    for spec, joint in zip(motion.joints, robot.joints, strict=True):
        assert spec.joint == joint.name
        assert spec.speeds[0] == pytest.approx(0.01 * joint.limits.velocity, rel=0.01)
        assert 0.25 * joint.limits.velocity < spec.speeds[-1] <= 0.81 * joint.limits.velocity
        ratios = np.diff(np.log(spec.speeds))
        np.testing.assert_allclose(ratios, ratios[0], rtol=0.02)
    fastest = max(runs, key=lambda run: abs(run.speed))
    assert (fastest.end - fastest.first) * CYCLE_S >= 0.3
    assert samples.duration_s < 1800.0


def test_walls_shorten_the_runs() -> None:
    robot = load_robot("ir361")
    wall = Plane(name="wall", normal=(-1.0, 0.0, 0.0), offset_m=-0.8)  # x stays below 0.8 m
    free = constant_velocity_motion(robot)
    walled = constant_velocity_motion(robot, Workspace(planes=(wall,)))
    path = walled.plan(robot, CYCLE_S).position
    assert forward(Chain.from_description(robot), path)[:, 0].max() < 0.8
    free_path = free.plan(robot, CYCLE_S).position
    assert forward(Chain.from_description(robot), free_path)[:, 0].max() > 0.8


def test_a_workspace_without_free_runs_is_refused_with_the_reason() -> None:
    robot = load_robot("ir361")
    wall = Plane(name="wall", normal=(-1.0, 0.0, 0.0), offset_m=5.0)  # x below -5 m: nowhere
    with raises_code(ConfigError, "RID-DESIGN-NONE", "2001"):
        constant_velocity_motion(robot, Workspace(planes=(wall,)))


def test_a_robot_that_can_collide_with_itself_gets_a_pose_without_collision() -> None:
    robot = load_robot("ur10e")
    bodies = tuple(
        Capsule(kind="capsule", link=link, start_m=(0, 0, 0), end_m=end, radius_m=0.06)
        for link, end in ((1, (0.0, 0.0, 0.1)), (3, (-0.5, 0.0, 0.0)), (6, (0.0, 0.0, 0.05)))
    )
    motion = constant_velocity_motion(robot.model_copy(update={"bodies": bodies}))
    assert len(motion.joints) == 6


def test_a_periodic_motion_is_extended_by_its_reversal() -> None:
    forward_motion = FourierMotion(
        kind="fourier",
        robot="r",
        period_s=4.0,
        periods=5,
        joints=(FourierJoint(joint="a", offset=0.1, sine=(0.2, 0.3), cosine=(0.4, -0.1)),),
    )
    both = reversed_motion(forward_motion)
    assert both.forward() == forward_motion
    back = both.reverse().joints[0]
    assert (back.offset, back.sine, back.cosine) == (0.1, (-0.2, -0.3), (0.4, -0.1))
