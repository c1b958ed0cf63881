"""The torque of one sample is compared with the regressor's kernels, term by term."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from config.errors import EstimationError
from config.load import load_robot
from config.robot.robot import RobotDescription
from dynamics.model.base_wrench import base_wrench
from dynamics.model.one_sample import BASE_WRENCH, SampleTorque
from dynamics.model.robot_model import RobotModel, torque
from tests.builders.raised_codes import raises_code

Motions = Callable[[int, int], np.ndarray]


def assert_same_torque(model: RobotModel, motion: np.ndarray, seed: int) -> None:
    rng = np.random.default_rng(seed)
    theta = rng.standard_normal(len(model.parameter_names))
    one = SampleTorque.of(model, theta)
    q, v, a = motion
    expected = torque(model, q, v, a, theta)
    found, base = np.empty_like(expected), np.empty((len(q), 6))
    for row, sample in enumerate(motion.transpose(1, 0, 2)):
        found[row] = one(*sample)
        base[row] = one.arrays[6][one.joints + BASE_WRENCH, :6]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    wrench = base_wrench(model, q, v, a, theta)
    np.testing.assert_allclose(base, wrench, rtol=1e-9, atol=1e-9 * np.abs(wrench).max())


@pytest.mark.parametrize("name", ["ir361", "kr15", "ur10e"])
def test_the_torque_of_bundled_robots_agrees(name: str, random_motion: Motions) -> None:
    """The robots have rotors on links, a spring and a coupled wrist."""
    robot = load_robot(name)
    assert_same_torque(RobotModel.from_description(robot), random_motion(len(robot.joints), 3), 4)


@pytest.mark.parametrize("seed", range(6))
def test_the_torque_of_any_chain_agrees(
    seed: int, random_arm: Callable[..., RobotDescription], random_motion: Motions
) -> None:
    """The chains have revolute and prismatic joints, and rotors on any link."""
    robot = random_arm(1 + seed, seed)
    assert_same_torque(RobotModel.from_description(robot), random_motion(1 + seed, seed), seed)


@pytest.mark.parametrize("smoothing", [0.0, 0.05])
def test_every_kind_of_friction_and_loss_agrees(
    smoothing: float, ir361: RobotDescription, random_motion: Motions
) -> None:
    kinds = (
        "coulomb", "viscous", "offset", "asymmetric", "cubic", "cube_root", "stribeck",
        "shear_thinning", "load",
    )  # fmt: skip
    changes: tuple[dict[str, object], ...]
    changes = ({}, {"efficiency": 0.8}, {"armature": True, "rotor": None})
    joints = tuple(
        joint.model_copy(update={"friction": kinds, **change})
        for joint, change in zip(ir361.joints, changes, strict=True)
    )
    robot = ir361.model_copy(update={"joints": joints})
    model = RobotModel.from_description(robot, sign_smoothing_rad_s=smoothing)
    assert_same_torque(model, random_motion(3, 7), 8)
    motion = random_motion(3, 9)
    motion[1, :4] = 0.0  # at rest
    assert_same_torque(model, motion, 10)


def test_a_spring_as_a_fourier_series_agrees(
    ir361: RobotDescription, random_motion: Motions
) -> None:
    assert ir361.spring is not None
    spring = ir361.spring.model_copy(update={"form": "fourier"})
    robot = ir361.model_copy(update={"spring": spring})
    assert_same_torque(RobotModel.from_description(robot), random_motion(3, 1), 2)


def test_temperature_dependent_friction_is_refused(ir361: RobotDescription) -> None:
    joints = tuple(j.model_copy(update={"friction": ("temperature",)}) for j in ir361.joints)
    model = RobotModel.from_description(ir361.model_copy(update={"joints": joints}))
    with raises_code(EstimationError, "RID-MODEL-TEMPERATURE"):
        SampleTorque.of(model, np.ones(len(model.parameter_names)))


def test_parameters_of_another_model_are_refused(ir361: RobotDescription) -> None:
    model = RobotModel.from_description(ir361)
    with raises_code(EstimationError, "RID-API-ARGUMENT", "30"):
        SampleTorque.of(replace(model, terms=model.terms[:1]), np.ones(41))
