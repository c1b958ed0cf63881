"""Derivatives and inertia compared with Pinocchio's algorithms and with central differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.arrays import FloatArray
from config.errors import EstimationError
from config.load import load_robot
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling
from dynamics.model.inverse_dynamics import mass_matrix, regressor_gradient, torque_derivatives
from dynamics.model.robot_model import RobotModel, regressor, torque
from dynamics.terms.conditions import Conditions
from tests.builders.raised_codes import raises_code

ARMS: list[tuple[int, int, str | None]]
ARMS = [(n, seed, None) for n in range(1, 8) for seed in range(2)]
ARMS += [(1, 0, "P"), (3, 0, "PPP"), (4, 0, "RPRP"), (7, 0, "R" * 7)]
STEP = 1e-5
WRIST = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -0.2], [0.0, 0.3, 0.9]])
EVERY_FRICTION = (
    "coulomb", "viscous", "offset", "cubic", "cube_root", "stribeck", "shear_thinning",
)  # fmt: skip


def links_only(robot) -> RobotModel:
    return RobotModel.from_description(robot, rotors=False, friction=False, spring=False)


def all_terms(ir361, coupling: np.ndarray | None = None) -> RobotModel:
    """Return the bundled arm with every term of a robot; an armature replaces rotor 3."""
    *joints, last = (
        joint.model_copy(update={"friction": EVERY_FRICTION}) for joint in ir361.joints
    )
    joints.append(last.model_copy(update={"armature": True, "rotor": None}))
    robot = ir361.model_copy(update={"joints": tuple(joints)})
    model = RobotModel.from_description(robot, payload=True, sign_smoothing_rad_s=0.3)
    if coupling is None:
        return replace(model, coupling=None)
    return replace(model, coupling=WristCoupling.of_matrix(coupling))


@pytest.fixture
def moving(random_motion):
    """Return a function that makes motions away from standstill.

    At standstill, cube root and sign are not differentiable.
    """

    def make(n: int, seed: int) -> np.ndarray:
        motion = random_motion(n, seed)
        motion[1] += np.sign(motion[1])
        return motion

    return make


def differences(function, motion: np.ndarray) -> np.ndarray:
    """Return central differences by q, v and a of every joint, (..., 3, n)."""
    out = []
    for kind in range(3):
        for joint in range(motion.shape[2]):
            ahead, behind = motion.copy(), motion.copy()
            ahead[kind, :, joint] += STEP
            behind[kind, :, joint] -= STEP
            out.append((function(*ahead) - function(*behind)) / (2.0 * STEP))
    return np.stack(out, axis=-1).reshape(*out[0].shape, 3, motion.shape[2])


@pytest.mark.parametrize(("n", "seed", "kinds"), ARMS)
def test_derivatives_of_the_torque_agree_with_pinocchio(
    n, seed, kinds, random_arm, judge, random_links, random_motion
) -> None:
    robot, links = random_arm(n, seed, kinds), random_links(n, seed)
    reference = judge(robot, links).model
    q, v, a = random_motion(n, seed)

    derivatives = torque_derivatives(links_only(robot), q, v, a, links.ravel())

    data = reference.createData()
    for k, sample in enumerate(zip(q, v, a, strict=True)):
        pin.computeRNEADerivatives(reference, data, *sample)
        inertia = np.triu(data.M) + np.triu(data.M, 1).T
        expected = data.dtau_dq, data.dtau_dv, inertia
        for ours, theirs in zip(derivatives, expected, strict=True):
            np.testing.assert_allclose(ours[k], theirs, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("n", "seed", "kinds"), ARMS)
def test_the_mass_matrix_agrees_with_pinocchio(
    n, seed, kinds, random_arm, judge, random_links
) -> None:
    robot, links = random_arm(n, seed, kinds), random_links(n, seed)
    reference = judge(robot, links).model
    q = np.random.default_rng(seed).uniform(-2.0, 2.0, (4, n))
    expected = []
    for sample in q:
        upper = np.triu(pin.crba(reference, reference.createData(), sample))
        expected.append(upper + np.triu(upper, 1).T)
    inertia = mass_matrix(links_only(robot), q, links.ravel())
    np.testing.assert_allclose(inertia, expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("coupling", [None, WRIST], ids=["plain", "coupled"])
def test_the_mass_matrix_contains_rotors_and_armatures_but_no_payload(ir361, coupling) -> None:
    """M v is the torque for an acceleration v minus that at rest; friction and spring cancel."""
    model = all_terms(ir361, coupling)
    rng = np.random.default_rng(2)
    theta, q, v = rng.standard_normal(len(model.parameter_names)), *rng.standard_normal((2, 4, 3))
    inertia = mass_matrix(model, q, theta)
    np.testing.assert_allclose(inertia, inertia.transpose(0, 2, 1), rtol=0, atol=1e-9)
    rest = np.zeros_like(q)
    accelerating = torque(model, q, rest, v, theta) - torque(model, q, rest, rest, theta)
    to_actuators = np.eye(3) if coupling is None else coupling.T
    expected = np.einsum("ij,sjk,sk->si", to_actuators, inertia, v)
    np.testing.assert_allclose(accelerating, expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize("payload", [False, True])
@pytest.mark.parametrize("coupling", [None, WRIST], ids=["plain", "coupled"])
def test_derivatives_of_every_term_agree_with_central_differences(
    ir361, coupling, payload, moving
) -> None:
    model, conditions = all_terms(ir361, coupling), Conditions(payload=payload)
    motion = moving(3, 4)
    theta = np.random.default_rng(4).standard_normal(len(model.parameter_names))

    def tau(q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        return torque(model, q, v, a, theta, conditions)

    q, v, a = motion
    derivatives = torque_derivatives(model, q, v, a, theta, conditions)
    expected = differences(tau, motion)
    for kind, ours in enumerate(derivatives):
        size = np.abs(expected[:, :, kind]).max()
        np.testing.assert_allclose(ours, expected[:, :, kind], rtol=0, atol=1e-7 * size)


def test_derivatives_with_gear_losses_agree_with_central_differences(ir361, moving) -> None:
    joints = tuple(joint.model_copy(update={"efficiency": 0.8}) for joint in ir361.joints)
    model = RobotModel.from_description(ir361.model_copy(update={"joints": joints}))
    assert model.transmission.losses
    motion = moving(3, 5)
    theta = np.random.default_rng(5).uniform(0.5, 1.0, len(model.parameter_names))
    expected = differences(lambda q, v, a: torque(model, q, v, a, theta), motion)
    q, v, a = motion
    for kind, ours in enumerate(torque_derivatives(model, q, v, a, theta)):
        size = np.abs(expected[:, :, kind]).max()
        np.testing.assert_allclose(ours, expected[:, :, kind], rtol=0, atol=1e-7 * size)


@pytest.mark.parametrize("coupling", [None, WRIST], ids=["plain", "coupled"])
def test_the_gradient_through_the_regressor_is_correct_for_every_term(
    ir361, coupling, moving
) -> None:
    model, conditions = all_terms(ir361, coupling), Conditions(payload=True)
    motion = moving(3, 6)
    weights = np.random.default_rng(6).standard_normal((8, 3, len(model.parameter_names)))

    def weighed(q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        return np.einsum("snp,snp->s", weights, regressor(model, q, v, a, conditions))

    q, v, a = motion
    gradient = regressor_gradient(model, q, v, a, weights, conditions)
    expected = differences(weighed, motion)
    for kind, ours in enumerate(gradient):
        size = np.abs(expected[:, kind]).max()
        np.testing.assert_allclose(ours, expected[:, kind], rtol=0, atol=1e-7 * size)


def test_the_gradient_includes_gear_losses(ir361, moving) -> None:
    joints = tuple(joint.model_copy(update={"efficiency": 0.8}) for joint in ir361.joints)
    model = RobotModel.from_description(ir361.model_copy(update={"joints": joints}))
    motion = moving(3, 7)
    rng = np.random.default_rng(7)
    weights = rng.standard_normal((8, 3, len(model.parameter_names)))
    conditions = Conditions(load_nm=rng.standard_normal((8, 3)))

    def weighed(q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        return np.einsum("snp,snp->s", weights, regressor(model, q, v, a, conditions))

    expected = differences(weighed, motion)
    q, v, a = motion
    for kind, ours in enumerate(regressor_gradient(model, q, v, a, weights, conditions)):
        size = np.abs(expected[:, kind]).max()
        np.testing.assert_allclose(ours, expected[:, kind], rtol=0, atol=1e-7 * size)


@settings(max_examples=40)
@given(
    n=st.integers(1, 7),
    seed=st.integers(0, 2**32 - 1),
    samples=st.integers(1, 20),
    kind=st.integers(0, 2),
)
def test_the_gradient_is_the_derivative_along_any_direction(
    n, seed, samples, kind, random_arm_once
) -> None:
    robot = random_arm_once(n, seed)
    model = RobotModel.from_description(robot, friction=False, spring=False)
    rng = np.random.default_rng(seed)
    motion = rng.uniform(-2.0, 2.0, (3, samples, n))
    weights = rng.standard_normal((samples, n, len(model.parameter_names)))
    line = rng.standard_normal((samples, n))

    def value(step: float) -> float:
        moved = motion.copy()
        moved[kind] += step * line
        return float(np.sum(weights * regressor(model, *moved)))

    q, v, a = motion
    slope = float(np.sum(regressor_gradient(model, q, v, a, weights)[kind] * line))
    expected = (value(STEP) - value(-STEP)) / (2.0 * STEP)
    size = np.abs(weights).sum() * max(1.0, np.abs(regressor(model, q, v, a)).max())
    assert slope == pytest.approx(expected, rel=1e-5, abs=1e-8 * size)


@pytest.fixture(scope="module")
def random_arm_once():
    """Return a function that makes chains of the bundled arm's joints, for use with hypothesis."""
    pattern = load_robot("ir361")

    def make(n: int, seed: int) -> RobotDescription:
        rng = np.random.default_rng(seed)
        row = pattern.kinematics.rows[0]
        keys = ("alpha_rad", "beta_rad", "theta_rad", "a_m", "d_m")
        rows = [
            row.model_copy(update=dict(zip(keys, rng.uniform(-0.9, 0.9, 5).tolist(), strict=True)))
            for _ in range(n)
        ]
        joints = []
        for i in range(n):
            joint = pattern.joints[0]
            assert joint.rotor is not None
            link = int(rng.integers(0, i + 2))
            way = rng.standard_normal(3)
            axis = tuple((way / np.linalg.norm(way)).tolist())
            rotor = joint.rotor.model_copy(update={"link": link, "axis": axis})
            kind = str(rng.choice(["revolute", "prismatic"]))
            update = {"name": f"j{i}", "type": kind, "rotor": rotor}
            joints.append(joint.model_copy(update=update))
        kinematics = pattern.kinematics.model_copy(update={"rows": tuple(rows)})
        update = {"kinematics": kinematics, "joints": tuple(joints), "spring": None}
        return pattern.model_copy(update=update)

    return make


def test_sums_of_wrong_shapes_are_refused(ir361, random_motion) -> None:
    model = links_only(ir361)
    q, v, a = random_motion(3, 0)
    with raises_code(EstimationError, "RID-API-ARGUMENT", "30"):
        regressor_gradient(model, q, v, a, np.zeros((8, 3, 29)))
    with raises_code(EstimationError, "RID-API-ARGUMENT", "30"):
        torque_derivatives(model, q, v, a, np.zeros(29))
    with raises_code(EstimationError, "RID-API-ARGUMENT", "30"):
        mass_matrix(model, q, np.zeros(29))
