"""The dynamics of an arm with elastic gears, compared with Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from config.arrays import FloatArray
from config.errors import EstimationError
from config.load import load_bundled_or_path, load_robot
from config.robot.robot import Joint, RobotDescription
from config.simulation.plant import PlantConfig, UnmodelledAxis, UnmodelledEffects
from dynamics.model.true_parameters import true_parameters
from identification.elasticity.elastic_arm import ElasticArm, ElasticMotion, SmallMotion
from identification.elasticity.elastic_runs import MultisineBins, multisine_torque
from identification.elasticity.link_motion import Gears, solve_links
from mock_hw.plant.rigid_bodies import BaseWrench, build_rigid_bodies
from tests.builders.raised_codes import raises_code, raises_invalid

STIFFNESS, DAMPING = np.array([5e4, 6e4, 2e4]), np.array([100.0, 110.0, 25.0])


@pytest.fixture(scope="module")
def robot() -> RobotDescription:
    """Return ir361 without its spring; the motor of axis 2 is on the link that it moves."""
    return load_robot("ir361").model_copy(update={"spring": None})


@pytest.fixture(scope="module")
def plant() -> PlantConfig:
    plant = load_bundled_or_path("ir361", "plants", PlantConfig)
    gears = tuple(UnmodelledAxis(joint_stiffness_nm_rad=k) for k in STIFFNESS.tolist())
    return plant.model_copy(update={"unmodelled": UnmodelledEffects(axes=gears), "spring": None})


@pytest.fixture(scope="module")
def arm(robot: RobotDescription) -> ElasticArm:
    return ElasticArm.of(robot, plate=True)


@pytest.fixture(scope="module")
def gears(arm: ElasticArm, robot: RobotDescription, plant: PlantConfig) -> Gears:
    """Return the true parameters of the simulated arm."""
    body = arm.base.from_standard(true_parameters(arm.links, robot, plant))
    rotor = np.array([axis.rotor_inertia_kg_m2 for axis in plant.axes])
    return Gears(STIFFNESS, DAMPING, rotor, body)


@pytest.fixture(scope="module")
def motion() -> ElasticMotion:
    random = np.random.default_rng(1)
    return ElasticMotion(*(random.normal(size=(20, 3)) * size for size in (1, 2, 9, 2, 9)))


def coordinates(motion: ElasticMotion) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return positions, velocities and accelerations of motors and links.

    The motor positions are arbitrary.
    """
    return (
        np.hstack([motion.q, motion.q]),
        np.hstack([motion.motor_v, motion.v]),
        np.hstack([motion.motor_a, motion.a]),
    )


def test_motor_and_link_torques_agree_with_pinocchio(
    arm: ElasticArm,
    gears: Gears,
    motion: ElasticMotion,
    robot: RobotDescription,
    plant: PlantConfig,
) -> None:
    bodies = build_rigid_bodies(robot, plant)
    data = bodies.model.createData()
    found = np.hstack(
        [
            arm.motor_torque(motion, gears.rotor),
            arm.link_torque(motion, gears.body, gears.rotor),
        ]
    )
    for row, (q, v, a) in enumerate(zip(*coordinates(motion), strict=True)):
        full = (bodies.gearing @ each for each in (q, v, a))
        torque = bodies.gearing.T @ pin.rnea(bodies.model, data, *full)
        assert found[row] == pytest.approx(torque, abs=1e-9)


def test_the_base_wrench_agrees_with_pinocchio(
    arm: ElasticArm,
    gears: Gears,
    motion: ElasticMotion,
    robot: RobotDescription,
    plant: PlantConfig,
) -> None:
    judge = BaseWrench(robot, plant)
    found = arm.base_wrench(motion, gears.body, gears.rotor)
    wrench = [judge(np.array(each)) for each in zip(*coordinates(motion), strict=True)]
    assert found == pytest.approx(np.array(wrench), abs=1e-9)


def test_links_follow_the_motors_as_springs_and_dampers_demand(
    arm: ElasticArm, gears: Gears
) -> None:
    """Harmonics from slow to fast; the fastest is at half the lowest resonance frequency."""
    random = np.random.default_rng(2)
    drawn = random.normal(size=(2, 31, 3))
    theta = np.asarray(0.02 * (drawn[0] + 1j * drawn[1]), dtype=np.complex128)
    theta *= np.where(np.arange(31) <= 10, 1.0, 0.02)[:, np.newaxis]
    theta[0] = [0.2, 0.3, 0.4]
    inertia = np.array([11.0, 12.0, 1.6])
    solved, bent, torque, is_settled = solve_links(arm, gears, theta, 6.0, 256, inertia)
    assert is_settled
    s = 2j * np.pi / 6.0 * np.arange(31)[:, np.newaxis]
    assert np.abs((STIFFNESS + s * DAMPING) * bent - torque).max() < 1e-4
    again = arm.link_torque(solved, gears.body, gears.rotor)
    assert np.fft.rfft(again, axis=0)[:31] / 256 == pytest.approx(torque, abs=1e-4)


def test_small_motions_agree_with_pinocchio(
    arm: ElasticArm, gears: Gears, robot: RobotDescription, plant: PlantConfig
) -> None:
    """The mass matrix of motors and links and the slope of gravity give the ratio of torque to
    motor motion.
    """
    pose = np.array([0.3, -0.2, 0.5])
    bodies = build_rigid_bodies(robot, plant)
    data = bodies.model.createData()

    def gravity(q: FloatArray) -> FloatArray:
        at = bodies.gearing @ np.hstack([pose, q])
        return np.asarray(bodies.gearing.T @ pin.computeGeneralizedGravity(bodies.model, data, at))[
            3:
        ]

    steps = 1e-5 * np.eye(3)
    slope = np.array([(gravity(pose + e) - gravity(pose - e)) / 2e-5 for e in steps]).T
    mass = bodies.gearing.T @ pin.crba(bodies.model, data, bodies.gearing @ np.tile(pose, 2))
    mass = mass @ bodies.gearing
    hz = np.array([2.0, 9.0, 14.0, 40.0])
    theta = np.random.default_rng(3).normal(size=(4, 3)).astype(np.complex128)
    run = MultisineBins(
        "run",
        hz,
        np.zeros(4, dtype=np.int64),
        theta,
        theta,
        np.ones(3),
        np.zeros((4, 3, 1), dtype=np.complex128),
        SmallMotion.of(arm, pose[np.newaxis]),
    )
    found = multisine_torque(run, gears)
    for row, s in enumerate(2j * np.pi * hz):
        gear = np.diag(STIFFNESS + s * DAMPING)
        stiff = np.block([[gear, -gear], [-gear, gear + slope]])
        whole = s**2 * mass + stiff
        link = np.linalg.solve(whole[3:, 3:], -whole[3:, :3] @ theta[row])
        torque = whole[:3, :3] @ theta[row] + whole[:3, 3:] @ link
        assert found[row] == pytest.approx(torque, rel=1e-6)


def test_a_coupled_wrist_is_refused() -> None:
    with raises_code(EstimationError, "RID-STIFFNESS-COUPLED-WRIST", "kr15"):
        ElasticArm.of(load_robot("kr15"))


def test_damping_needs_a_stiffness() -> None:
    joint = load_robot("ir361").joints[0].model_dump()
    assert Joint.model_validate(joint | {"stiffness_nm_rad": 5e4, "damping_nm_s": 40.0})
    with raises_invalid("", "stiffness_nm_rad"):
        Joint.model_validate(joint | {"damping_nm_s": 40.0})
