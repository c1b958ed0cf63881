"""`at_temperature` replaces temperature-dependent friction by friction at one temperature.

Torques and intervals at this temperature stay the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.friction_terms import FrictionTerm
from dynamics.model.memory import with_presliding_history
from dynamics.model.one_sample import SampleTorque
from dynamics.model.robot_model import regressor
from dynamics.terms.conditions import Conditions
from identification.estimation.at_temperature import at_temperature, depends_on_temperature
from identification.estimation.estimate import Estimate, predict
from identification.estimation.fitted_signals import fit_smoothed
from identification.validation.robot_terms import with_friction
from tests.builders.presliding_arm import arm
from tests.builders.raised_codes import raises_code
from tests.builders.warming_arm import motion, recording

TERMS: dict[str, tuple[FrictionTerm, ...]] = {
    "coulomb and viscous": ("coulomb", "viscous", "temperature"),
    "in another order": ("temperature", "viscous", "coulomb", "offset"),
    "asymmetric": ("asymmetric", "temperature", "viscous"),
    "without viscous": ("coulomb", "cube_root", "temperature"),
    "alone": ("temperature",),
    "with memory": ("coulomb", "viscous", "presliding", "temperature"),
}
WARM_K: FloatArray = np.array([320.0, 290.0, 305.0])


def identify_warm_arm(terms: tuple[FrictionTerm, ...]) -> Estimate:
    """Return the estimate of an arm with `terms` in two axes; the drives warm up by 10 to 20 K."""
    robot = with_friction(arm(), [terms, ("coulomb", "viscous"), terms])
    signals = recording(30.0, (None, None, None))
    rise = np.linspace(0.0, 20.0, len(signals))[:, np.newaxis] * np.array([1.0, 0.5, 0.8])
    return fit_smoothed(robot, [replace(signals, temperature_k=298.15 + rise)]).estimate()


@pytest.mark.parametrize("terms", TERMS.values(), ids=TERMS)
def test_torques_and_intervals_equal_those_at_that_temperature(
    terms: tuple[FrictionTerm, ...],
) -> None:
    estimate = identify_warm_arm(terms)
    plain = at_temperature(estimate, WARM_K)
    assert depends_on_temperature(estimate).tolist() == [True, False, True]
    assert not depends_on_temperature(plain).any()
    q, v, a = motion(10.0, 3)
    warm = Conditions(temperature_k=WARM_K)
    np.testing.assert_allclose(
        predict(plain, q, v, a), predict(estimate, q, v, a, warm), rtol=1e-9, atol=1e-7
    )
    few = slice(0, 500, 10)
    sigmas = []
    for each, given in ((plain, None), (estimate, warm)):
        conditions = with_presliding_history(each.model, q[few], given)
        phi = each.base.columns(regressor(each.model, q[few], v[few], a[few], conditions))
        sigmas.append(np.einsum("sjb,bc,sjc->sj", phi, each.covariance_jackknife, phi))
    np.testing.assert_allclose(sigmas[0], sigmas[1], rtol=1e-6, atol=1e-9)


def test_a_controller_can_evaluate_it_sample_by_sample() -> None:
    estimate = identify_warm_arm(TERMS["coulomb and viscous"])
    with raises_code(EstimationError, "RID-MODEL-TEMPERATURE"):
        SampleTorque.of(estimate.model, estimate.standard_values)
    plain = at_temperature(estimate, WARM_K)
    q, v, a = (values[40] for values in motion(10.0, 3))
    np.testing.assert_allclose(
        SampleTorque.of(plain.model, plain.standard_values)(q, v, a),
        predict(plain, q[np.newaxis], v[np.newaxis], a[np.newaxis])[0],
        rtol=1e-9,
    )


def test_terms_requested_for_every_joint_are_kept() -> None:
    of_all = with_friction(arm(), [TERMS["coulomb and viscous"]] * 3)
    signals = recording(30.0, (None, None, None))
    rise = np.linspace(298.15, 318.0, len(signals))[:, np.newaxis] * np.ones(3)
    named = fit_smoothed(of_all, [replace(signals, temperature_k=rise)]).estimate()
    by_option = replace(
        named,
        robot=arm(),
        options=replace(named.options, friction_terms=TERMS["coulomb and viscous"]),
    )
    np.testing.assert_allclose(
        at_temperature(by_option, WARM_K).values, at_temperature(named, WARM_K).values
    )


def test_a_model_without_temperature_is_unchanged() -> None:
    estimate = at_temperature(identify_warm_arm(TERMS["coulomb and viscous"]), WARM_K)
    assert at_temperature(estimate, WARM_K) is estimate


def test_temperatures_of_other_joints_are_refused() -> None:
    estimate = identify_warm_arm(TERMS["coulomb and viscous"])
    with raises_code(EstimationError, "RID-API-ARGUMENT"):
        at_temperature(estimate, WARM_K[:2])
