"""Start poses of a motion: free of collisions, with holding torques within the limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from config.errors import ConfigError
from config.robot.bodies import Capsule
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.link_cad import LinkCad
from config.robot.robot import Joint, JointLimits, RobotDescription
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import torque
from identification.design.criteria import DOptimal
from identification.design.easier_problems import easier_problems
from identification.design.model import design_model
from identification.design.problem import ExcitationProblem
from identification.design.search import refine_start
from tests.builders.raised_codes import raises_code

REACH_M = 0.4
MASS_KG = 5.0
WEIGHT_NM = MASS_KG * 9.81 * REACH_M


def swinging_arm(torque_nm: float, low: float = -3.0, high: float = 3.0) -> RobotDescription:
    """Return a heavy arm that swings about a horizontal axis, and a hand that turns.

    The arm is horizontal at zero and hangs at -pi / 2.
    """
    limits = JointLimits(
        position_min=low, position_max=high, velocity=3.0, acceleration=15.0, torque=torque_nm
    )
    hand = JointLimits(
        position_min=-3.0, position_max=3.0, velocity=3.0, acceleration=15.0, torque=5.0
    )
    heavy = LinkCad(
        mass_kg=MASS_KG, centre_m=(REACH_M, 0.0, 0.0), inertia_kg_m2=(0.01, 0, 0, 0.05, 0, 0.05)
    )
    light = LinkCad(mass_kg=0.2, inertia_kg_m2=(1e-3, 0, 0, 1e-3, 0, 1e-3))
    return RobotDescription(
        name="swing",
        kinematics=Kinematics(
            convention="modified_dh",
            rows=(KinematicRow(alpha_rad=np.pi / 2), KinematicRow(alpha_rad=np.pi / 2)),
        ),
        joints=(Joint(name="lift", limits=limits), Joint(name="turn", limits=hand)),
        cad=(heavy, light),
    )


def problem(robot: RobotDescription) -> ExcitationProblem:
    return ExcitationProblem(
        robot=robot,
        period_s=5.0,
        harmonics=4,
        criterion=DOptimal(),
        limit_fraction=0.95,
        expected_noise_nm=np.array([0.1, 0.05]),
        parameters=cad_parameters(design_model(robot), robot)[0],
    )


def test_a_weak_arm_starts_and_moves_where_its_motor_can_hold_it() -> None:
    robot = swinging_arm(0.3 * WEIGHT_NM)
    task = problem(robot)
    for seed in range(3):
        pose = task.motion(task.start(seed), task._coarse)[0].mean(axis=0)[np.newaxis]
        rest = np.zeros((1, 2))
        assert task.parameters is not None
        held = torque(task.model, pose, rest, rest, task.parameters)[0, 0]
        assert abs(held) < 0.35 * WEIGHT_NM
    found = refine_start(task, 0, 0.01)
    assert found.check.broken == ()
    assert np.isfinite(found.check.objective)


def test_a_rare_feasible_pose_is_found_by_descent() -> None:
    """The motor can hold the arm only if it is nearly vertical, which few random poses are."""
    robot = swinging_arm(0.004 * WEIGHT_NM)
    task = problem(robot)
    pose = task.motion(task.start(1), task._coarse)[0].mean(axis=0)
    assert min(abs(pose[0] - end) for end in (-np.pi / 2, np.pi / 2)) < 0.1


def test_an_arm_that_its_motor_cannot_hold_is_refused_with_the_torques() -> None:
    robot = swinging_arm(0.3 * WEIGHT_NM, low=-0.5, high=0.5)
    least = WEIGHT_NM * np.cos(0.5 * 0.8 * 0.95)
    with raises_code(ConfigError, "RID-DESIGN-NONE", "5.59", f"torque of {least:.2g}"[:-1]):
        problem(robot).start(0)


def test_bodies_that_always_collide_are_refused_with_their_distance() -> None:
    base = Capsule(kind="capsule", link=0, start_m=(0, 0, 0), end_m=(0, 0, 0), radius_m=0.1)
    hand = Capsule(kind="capsule", link=2, start_m=(0, 0, 0), end_m=(0, 0, 0), radius_m=0.1)
    robot = swinging_arm(2.0 * WEIGHT_NM).model_copy(update={"bodies": (base, hand)})
    with raises_code(ConfigError, "RID-DESIGN-NONE", "0.02"):
        problem(robot).start(0)


def test_a_motion_between_bodies_is_reduced_until_it_is_free() -> None:
    """The arm is surrounded by posts: only a narrow part of the lift axis's range is free."""
    post = [
        Capsule(
            kind="capsule",
            link=0,
            start_m=(0.5 * np.cos(angle), -0.3, 0.5 * np.sin(angle)),
            end_m=(0.5 * np.cos(angle), 0.3, 0.5 * np.sin(angle)),
            radius_m=0.05,
        )
        for angle in np.arange(0.0, 2.0 * np.pi, 0.69)
    ]
    arm = Capsule(kind="capsule", link=2, start_m=(0, 0, 0.4), end_m=(0, 0, 0.6), radius_m=0.02)
    robot = swinging_arm(2.0 * WEIGHT_NM).model_copy(update={"bodies": (*post, arm)})
    found = refine_start(problem(robot), 1, 0.01, iterations=30)
    assert found.check.broken == ()
    clear = [use for use in found.check.uses if use.what.startswith("distance")]
    assert min(use.used for use in clear) < 0.06
    lift = found.motion.trajectory(robot, 0.01)
    assert np.ptp(lift.position(lift.sample_times_s)[:, 0]) < 0.69


def test_fewer_harmonics_are_tried_before_longer_periods() -> None:
    task = problem(swinging_arm(WEIGHT_NM))
    changes = [words for words, _ in easier_problems(task)]
    assert changes == ["2 harmonics", "2 harmonics of 10 s", "2 harmonics of 20 s"]
    changes = [words for words, _ in easier_problems(replace(task, harmonics=2))]
    assert changes == ["2 harmonics of 10 s", "2 harmonics of 20 s"]
