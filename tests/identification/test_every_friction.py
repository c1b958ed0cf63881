"""Every friction function in every backend: equal results, or the backend refuses it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import ModuleType
from typing import cast, get_args

import numpy as np
import pytest

from config.arrays import FloatArray
from config.errors import EstimationError
from config.load import load_robot
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from dynamics.model.inverse_dynamics import torque_derivatives
from dynamics.model.nonlinear_slopes import nonlinear_slopes
from dynamics.model.one_sample import SampleTorque
from dynamics.model.robot_model import RobotModel, regressor, torque
from dynamics.terms.conditions import Conditions
from dynamics.terms.friction import Friction
from dynamics.terms.friction_functions import FRICTION_FUNCTIONS, FrictionFunction
from identification.consistency.constraints import not_negative
from identification.export.function import python_function
from identification.export.model import ExportModel

TERMS: dict[FrictionFunction, tuple[FrictionTerm, ...]] = {
    "coulomb": ("coulomb",),
    "viscous": ("viscous",),
    "offset": ("offset",),
    "forward": ("asymmetric",),
    "backward": ("asymmetric",),
    "cubic": ("cubic",),
    "cube_root": ("cube_root",),
    "stribeck": ("stribeck",),
    "shear_thinning": ("shear_thinning",),
    "coulomb_by_temperature": ("coulomb", "viscous", "temperature"),
    "viscous_by_temperature": ("coulomb", "viscous", "temperature"),
}
WARM_K = np.array([300.0, 310.0, 320.0])
WARM = Conditions(temperature_k=WARM_K)
Q, V, A = np.random.default_rng(5).uniform(-2.0, 2.0, (3, 12, 3))
UNKNOWN = "RID-MODEL-TERM"


@dataclass(frozen=True)
class Case:
    """A model in which the coefficients of all but one friction function are zero."""

    robot: RobotDescription
    model: RobotModel
    parameters: FloatArray


def case(function: FrictionFunction) -> Case:
    robot = load_robot("ir361")
    joints = tuple(joint.model_copy(update={"friction": TERMS[function]}) for joint in robot.joints)
    robot = robot.model_copy(update={"joints": joints})
    model = RobotModel.from_description(robot, sign_smoothing_rad_s=0.1)
    own = FRICTION_FUNCTIONS[function].symbol
    values = [
        1.0 + 0.3 * k if name.split("_")[0] == own else 0.0
        for k, name in enumerate(model.parameter_names)
    ]
    return Case(robot, model, np.array(values))


def with_unknown_function(known: Case, function: str) -> Case:
    """Return the model with a friction function that no backend supports."""
    unknown = cast("FrictionFunction", function)
    terms = tuple(
        replace(term, columns=tuple(replace(c, function=unknown) for c in term.columns))
        if isinstance(term, Friction)
        else term
        for term in known.model.terms
    )
    return replace(known, model=replace(known.model, terms=terms))


def one_sample(known: Case) -> FloatArray:
    one = SampleTorque.of(known.model, known.parameters)
    return np.array([one(*sample) for sample in zip(Q, V, A, strict=True)])


def exported_torque(known: Case) -> FloatArray:
    written = ModuleType("written")
    text = python_function(ExportModel(known.robot, known.model, known.parameters))
    exec(compile(text, "written", "exec"), written.__dict__)
    warm = any("temperature" in joint.friction for joint in known.robot.joints)
    more = {"temperature_k": np.tile(WARM_K, (12, 1))} if warm else {}
    return np.asarray(written.inverse_dynamics(Q, V, A, **more))


BACKENDS: dict[str, Callable[[Case], object]] = {
    "torque": lambda c: torque(c.model, Q, V, A, c.parameters, WARM),
    "regressor": lambda c: regressor(c.model, Q, V, A, WARM),
    "gradient": lambda c: torque_derivatives(c.model, Q, V, A, c.parameters, WARM),
    "nonlinear slopes": lambda c: nonlinear_slopes(c.model, Q, V, A, c.parameters, WARM),
    "one sample": one_sample,
    "consistency": lambda c: not_negative(c.model, c.robot),
    "export": exported_torque,
    "straight export": lambda c: ExportModel(c.robot, c.model, c.parameters).omitted_properties(
        armatures=True
    ),
}


def test_every_function_has_a_row_and_a_case() -> None:
    assert set(FRICTION_FUNCTIONS) == set(TERMS) == set(get_args(FrictionFunction))
    symbols = [row.symbol for row in FRICTION_FUNCTIONS.values()]
    assert len(set(symbols)) == len(symbols)


@pytest.mark.parametrize("function", TERMS)
def test_the_backends_agree(function: FrictionFunction) -> None:
    single = case(function)
    expected = torque(single.model, Q, V, A, single.parameters, WARM)
    assert np.abs(expected).max() > 0.1
    found = regressor(single.model, Q, V, A, WARM) @ single.parameters
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(exported_torque(single), expected, rtol=1e-9, atol=1e-9)
    if FRICTION_FUNCTIONS[function].kernel is not None:
        np.testing.assert_allclose(one_sample(single), expected, rtol=1e-9, atol=1e-9)
    assert not_negative(single.model, single.robot).shape[1] == len(single.parameters)


@pytest.mark.parametrize("function", ["coulomb_by_temperature", "viscous_by_temperature"])
def test_one_sample_refuses_friction_that_needs_a_temperature(function: FrictionFunction) -> None:
    with pytest.raises(EstimationError) as refused:
        one_sample(case(function))
    assert refused.value.refusal == "RID-MODEL-TEMPERATURE"


@pytest.mark.parametrize("backend", BACKENDS)
def test_every_backend_refuses_an_unknown_function(backend: str) -> None:
    with pytest.raises(EstimationError) as refused:
        BACKENDS[backend](with_unknown_function(case("coulomb"), "sticky"))
    assert refused.value.refusal == UNKNOWN
