"""Every model term in every backend: equal results, or the backend refuses it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np
import pytest

from config.arrays import FloatArray
from config.errors import EstimationError
from config.load import load_robot
from config.robot.robot import RobotDescription
from dynamics.model.base_wrench import base_wrench, base_wrench_gradient
from dynamics.model.inverse_dynamics import mass_matrix, regressor_gradient, torque_derivatives
from dynamics.model.one_sample import SampleTorque
from dynamics.model.robot_model import RobotModel, base_wrench_regressor, regressor, torque
from dynamics.terms.conditions import Conditions
from dynamics.terms.motion import TermMotion
from dynamics.terms.term import Term
from identification.consistency.constraints import not_negative
from identification.export.function import python_function
from identification.export.model import ExportModel
from tests.builders.raised_codes import raises_code

STEP = 1e-6
KINDS = ("coulomb", "viscous", "offset", "cubic", "stribeck", "shear_thinning")


def arm(armature: bool = False) -> RobotDescription:
    """Return the bundled three-axis arm with a spring, rotors or armatures, and all friction terms.

    Armatures and rotors exclude each other on a joint.
    """
    robot = load_robot("ir361")
    changes = {"armature": True, "rotor": None} if armature else {}
    joints = tuple(
        joint.model_copy(update={"friction": KINDS, **changes}) for joint in robot.joints
    )
    return robot.model_copy(update={"joints": joints})


TERMS = ("rigid_body", "rotors", "armature", "friction", "spring", "payload")


@dataclass(frozen=True)
class OneTerm:
    """A model in which the parameters of all but one term are zero."""

    robot: RobotDescription
    model: RobotModel
    parameters: FloatArray
    conditions: Conditions


def one_term(name: str) -> OneTerm:
    robot = arm(armature=name == "armature")
    model = RobotModel.from_description(robot, payload=True, sign_smoothing_rad_s=0.1)
    columns = model.parameter_groups[name]
    parameters = np.zeros(len(model.parameter_names))
    count = columns.stop - columns.start
    parameters[columns] = np.random.default_rng(1).uniform(0.5, 2.0, count)
    return OneTerm(robot, model, parameters, Conditions(payload=name == "payload"))


Triple = tuple[FloatArray, FloatArray, FloatArray]


def random_triple(rows: FloatArray) -> Triple:
    q, v, a = rows
    return q, v, a


@pytest.fixture
def motion() -> Triple:
    return random_triple(np.random.default_rng(2).uniform(0.2, 2.0, (3, 8, 3)))


def move_both_ways(motion: Triple, order: int, joint: int) -> tuple[Triple, Triple]:
    ahead, behind = np.array(motion), np.array(motion)
    ahead[order, :, joint] += STEP
    behind[order, :, joint] -= STEP
    return random_triple(ahead), random_triple(behind)


@pytest.mark.parametrize("name", TERMS)
class TestEveryTerm:
    def test_the_torque_is_the_regressor_times_the_parameters(
        self, name: str, motion: Triple
    ) -> None:
        case = one_term(name)
        tau = torque(case.model, *motion, case.parameters, case.conditions)
        columns = regressor(case.model, *motion, case.conditions)
        np.testing.assert_allclose(tau, columns @ case.parameters, rtol=1e-12, atol=1e-12)
        assert np.abs(tau).max() > 0.1, "the term has no effect"

    def test_the_gradients_equal_the_derivatives_of_torque_and_regressor(
        self, name: str, motion: Triple
    ) -> None:
        case = one_term(name)
        by = torque_derivatives(case.model, *motion, case.parameters, case.conditions)
        phi = regressor(case.model, *motion, case.conditions)
        weights = np.random.default_rng(3).standard_normal(phi.shape)
        by_weights = regressor_gradient(case.model, *motion, weights, case.conditions)
        for order in range(3):
            for joint in range(3):
                sides = move_both_ways(motion, order, joint)
                taus = [torque(case.model, *m, case.parameters, case.conditions) for m in sides]
                slope = (taus[0] - taus[1]) / (2.0 * STEP)
                np.testing.assert_allclose(by[order][:, :, joint], slope, rtol=1e-6, atol=1e-5)
                sums = [
                    (weights * regressor(case.model, *m, case.conditions)).sum(axis=(1, 2))
                    for m in sides
                ]
                slope = (sums[0] - sums[1]) / (2.0 * STEP)
                np.testing.assert_allclose(by_weights[order][:, joint], slope, rtol=1e-6, atol=1e-4)

    def test_the_base_wrench_and_its_gradient_agree(self, name: str, motion: Triple) -> None:
        case = one_term(name)
        still = replace(case.conditions, payload=False)
        wrench = base_wrench(case.model, *motion, case.parameters)
        columns = base_wrench_regressor(case.model, *motion, still)
        np.testing.assert_allclose(wrench, columns @ case.parameters, rtol=1e-12, atol=1e-12)
        weights = np.random.default_rng(4).standard_normal(wrench.shape)
        by = base_wrench_gradient(case.model, *motion, case.parameters, weights)
        for joint in range(3):
            ahead, behind = (
                (weights * base_wrench(case.model, *m, case.parameters)).sum(axis=1)
                for m in move_both_ways(motion, 0, joint)
            )
            slope = (ahead - behind) / (2.0 * STEP)
            np.testing.assert_allclose(by[0][:, joint], slope, rtol=1e-5, atol=1e-4)

    def test_the_inertia_is_the_derivative_of_the_torque_by_acceleration(
        self, name: str, motion: Triple
    ) -> None:
        case = one_term(name)
        inertia = mass_matrix(case.model, motion[0], case.parameters)
        rest = np.zeros_like(motion[0])
        for joint in range(3):
            pushed = rest.copy()
            pushed[:, joint] = 1.0
            ahead, still = (
                torque(case.model, motion[0], rest, a, case.parameters) for a in (pushed, rest)
            )
            np.testing.assert_allclose(inertia[:, :, joint], ahead - still, rtol=1e-9, atol=1e-9)

    def test_one_sample_equals_the_torque_without_payload(self, name: str, motion: Triple) -> None:
        case = one_term(name)
        one = SampleTorque.of(case.model, case.parameters)
        expected = torque(case.model, *motion, case.parameters)
        found = np.array([one(*sample) for sample in zip(*motion, strict=True)])
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)

    def test_the_exported_function_equals_the_torque(self, name: str, motion: Triple) -> None:
        case = one_term(name)
        written = ModuleType("written")
        text = python_function(ExportModel(case.robot, case.model, case.parameters))
        exec(compile(text, "written", "exec"), written.__dict__)
        attached = {"payload": True} if name == "payload" else {}
        found = written.inverse_dynamics(*motion, **attached)
        expected = torque(case.model, *motion, case.parameters, case.conditions)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


@dataclass(frozen=True)
class Cable:
    """A new term that the backends without columns do not support."""

    name = "cable"
    through_gears = False
    inertial = False
    parameter_names = ("k_cable",)
    parameter_units = ("N m/rad",)

    def fill_torque(self, motion: TermMotion, out: FloatArray) -> None:
        out[:, 0, 0] = motion.joint[0, :, 0]

    def fill_base_wrench(self, motion: TermMotion, out: FloatArray) -> None:
        pass

    def torque_gradient(self, motion: TermMotion, weights: FloatArray) -> FloatArray:
        out = np.zeros((len(weights), *motion.joint.shape))
        out[:, 0, :, 0] = weights[:, :, 0, 0]
        return out


@pytest.mark.parametrize(
    "backend",
    [
        lambda robot, model, values: SampleTorque.of(model, values),
        ExportModel,
        lambda robot, model, values: not_negative(model, robot),
    ],
)
def test_a_backend_refuses_an_unknown_term(
    backend: Callable[[RobotDescription, RobotModel, FloatArray], object],
) -> None:
    robot = arm()
    plain = RobotModel.from_description(robot)
    term: Term = Cable()
    model = replace(plain, terms=(*plain.terms, term))
    with raises_code(EstimationError, "RID-MODEL-TERM", "cable"):
        backend(robot, model, np.ones(len(model.parameter_names)))
