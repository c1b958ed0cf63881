from __future__ import annotations

import numpy as np
import pytest

from acquisition.motion.kinds.fourier import FourierMotion
from config.errors import ConfigError
from config.load import load_robot
from config.robot.bodies import Plane, Workspace
from config.robot.robot import RobotDescription
from dynamics.geometry.clearances import Clearances
from identification.design.two_harmonic import (
    TwoHarmonicOptions,
    condition_number,
    design_two_harmonic,
)
from tests.builders.raised_codes import raises_code


@pytest.fixture(scope="module")
def robot() -> RobotDescription:
    return load_robot("ir361")


def designed(robot: RobotDescription, *, tries: int = 20, seed: int = 0) -> FourierMotion:
    return design_two_harmonic(
        robot, TwoHarmonicOptions(10.0, highest_harmonic=8, tries=tries, seed=seed), 0.008
    )


def test_each_axis_has_one_low_and_one_high_harmonic(robot: RobotDescription) -> None:
    for joint in designed(robot).joints:
        amplitude = np.hypot(joint.sine, joint.cosine)
        low, high = (int(k) + 1 for k in np.flatnonzero(amplitude))
        assert low <= 2
        assert 5 <= high <= 8


@pytest.mark.parametrize("seed", range(4))
def test_every_limit_is_kept_with_a_margin(robot: RobotDescription, seed: int) -> None:
    trajectory = designed(robot, tries=1, seed=seed).trajectory(robot, 0.008)
    times = np.linspace(0.0, 10.0, 20_000)
    for values, limit in (
        (trajectory.velocity(times), "velocity"),
        (trajectory.acceleration(times), "acceleration"),
    ):
        share = np.abs(values).max(axis=0) / [getattr(j.limits, limit) for j in robot.joints]
        assert (share <= 0.85 + 1e-4).all()
    q = trajectory.position(times)
    for j, joint in enumerate(robot.joints):
        middle = (joint.limits.position_max + joint.limits.position_min) / 2.0
        half = (joint.limits.position_max - joint.limits.position_min) / 2.0
        assert np.abs(q[:, j] - middle).max() <= 0.85 * half + 1e-4


def test_the_motion_depends_on_the_seed_alone(
    robot: RobotDescription,
) -> None:
    assert designed(robot, seed=1) == designed(robot, seed=1)
    assert designed(robot, seed=1) != designed(robot, seed=2)


def test_more_tries_never_worsen_the_result(robot: RobotDescription) -> None:
    numbers = [condition_number(robot, designed(robot, tries=tries)) for tries in (1, 5, 40)]
    assert numbers[0] >= numbers[1] >= numbers[2]
    assert numbers[2] < 60.0


def test_a_robot_with_six_axes_can_be_designed_for() -> None:
    robot = load_robot("ur10e").model_copy(update={"bodies": ()})
    motion = design_two_harmonic(
        robot, TwoHarmonicOptions(20.0, highest_harmonic=10, tries=10), 0.01
    )
    assert condition_number(robot, motion) < 15.0


def test_draws_with_self_collision_are_rejected() -> None:
    robot = load_robot("ur10e")
    with raises_code(ConfigError, "RID-DESIGN-NONE"):
        design_two_harmonic(robot, TwoHarmonicOptions(20.0, tries=3), 0.01)


def test_the_best_draw_without_collision_is_chosen(robot: RobotDescription) -> None:
    wall = Plane(name="wall", normal=(0.0, 0.0, -1.0), offset_m=0.5)
    workspace = Workspace(planes=(wall,), clearance_m=0.02)
    motion = design_two_harmonic(
        robot, TwoHarmonicOptions(10.0, tries=50), 0.008, workspace=workspace
    )
    samples = motion.plan(robot, 0.008)
    assert Clearances.of(robot, workspace).nearest(samples.position).min() >= 0.02
    free = design_two_harmonic(robot, TwoHarmonicOptions(10.0, tries=50), 0.008)
    path = free.plan(robot, 0.008).position
    assert Clearances.of(robot, workspace).nearest(path).min() < 0.02


def test_an_axis_at_rest_has_no_finite_condition_number(robot: RobotDescription) -> None:
    motion = designed(robot)
    still = motion.joints[0].model_copy(update={"sine": (0.0,), "cosine": (0.0,)})
    stopped = motion.model_copy(update={"joints": (still, *motion.joints[1:])})
    assert condition_number(robot, stopped) == np.inf


def test_a_period_without_a_whole_number_of_cycles_is_refused(robot: RobotDescription) -> None:
    with raises_code(ConfigError, "RID-MOTION-PERIOD", "1250", "1251"):
        design_two_harmonic(robot, TwoHarmonicOptions(10.001, tries=1), 0.008)


@pytest.mark.parametrize(
    "arguments", [{"highest_harmonic": 1}, {"tries": 0}, {"limit_fraction": 1.5}]
)
def test_invalid_arguments_are_refused(
    robot: RobotDescription, arguments: dict[str, float]
) -> None:
    with raises_code(ConfigError, "RID-OPTION-RANGE"):
        design_two_harmonic(robot, TwoHarmonicOptions(10.0, **arguments), 0.008)  # type: ignore[arg-type]
