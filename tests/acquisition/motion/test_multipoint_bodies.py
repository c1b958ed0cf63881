"""Random validation poses, and the moves between them, avoid self-collision."""

from __future__ import annotations

import numpy as np

from acquisition.motion.kinds.multipoint import MultipointMotion
from config.errors import ConfigError
from config.robot.bodies import Capsule
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription
from dynamics.geometry.clearances import Clearances
from tests.builders.raised_codes import raises_code

LIMITS = JointLimits(
    position_min=-3.0, position_max=3.0, velocity=2.0, acceleration=8.0, torque=50.0
)


def robot(*bodies: Capsule) -> RobotDescription:
    """Return three parallel axes with 0.5 m between them."""
    return RobotDescription(
        name="flat",
        kinematics=Kinematics(
            convention="modified_dh",
            rows=(KinematicRow(), KinematicRow(a_m=0.5), KinematicRow(a_m=0.5)),
        ),
        joints=tuple(Joint(name=f"j{i}", limits=LIMITS) for i in (1, 2, 3)),
        bodies=bodies,
    )


def ball(link: int, place_m: tuple[float, float, float], radius_m: float) -> Capsule:
    return Capsule(kind="capsule", link=link, start_m=place_m, end_m=place_m, radius_m=radius_m)


def test_no_row_of_the_motion_collides() -> None:
    arm = robot(ball(0, (0.0, 0.0, 0.0), 0.4), ball(3, (0.0, 0.0, 0.0), 0.2))
    motion = MultipointMotion(kind="multipoint", robot="flat", seed=1)
    open_arm = robot()
    assert not Clearances.of(arm).is_clear(motion.plan(open_arm, 0.02).position)
    samples = motion.plan(arm, 0.02)
    assert Clearances.of(arm).is_clear(samples.position)
    assert len(motion.draw_poses(arm)) == 20


def test_without_bodies_the_points_depend_on_the_seed_alone() -> None:
    motion = MultipointMotion(kind="multipoint", robot="flat", seed=4, range_fraction=0.5)
    draws = np.random.default_rng(4).uniform(-1.0, 1.0, (20, 3))
    np.testing.assert_allclose(motion.draw_poses(robot()), 1.5 * draws)


def test_bodies_that_leave_no_free_pose_are_refused_with_the_remedy() -> None:
    full = robot(ball(0, (0.0, 0.0, 0.0), 0.9), ball(3, (0.0, 0.0, 0.0), 0.2))
    motion = MultipointMotion(kind="multipoint", robot="flat", seed=1)
    with raises_code(ConfigError, "RID-DESIGN-NONE", "1000"):
        motion.plan(full, 0.02)
