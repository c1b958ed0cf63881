"""Estimators in the time domain: simulate, then estimate, compared with independent solvers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

from acquisition.processing.smoothing import SmoothedSignals
from config.load import load_robot
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, regressor, torque
from identification.estimation.estimate import predict
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions, Prior
from identification.model.base_parameters import BaseParameters, base_parameters
from identification.model.options import ModelOptions

STEP_S = 0.01
Run = Callable[..., SmoothedSignals]


def friction(robot: RobotDescription, terms: tuple[str, ...], **more: Any) -> RobotDescription:
    joints = tuple(j.model_copy(update={"friction": terms, **more}) for j in robot.joints)
    return robot.model_copy(update={"joints": joints})


@pytest.fixture(scope="module")
def robot() -> RobotDescription:
    return load_robot("ir361")


@pytest.fixture(scope="module")
def truth(robot: RobotDescription) -> Callable[[RobotModel], np.ndarray]:
    """Return a function that gives the standard parameters of a plausible arm for a model."""
    known = {"m1": 50.0, "m2": 30.0, "m3": 15.0, "k_spring": 8e3, "P0_spring": 3e3}

    def of(model: RobotModel) -> np.ndarray:
        random = np.random.default_rng(3)
        values = []
        for name in model.parameter_names:
            size = 20.0 if name.startswith(("fc", "fv", "fs")) else 1.0
            value = known.get(name, size * random.uniform(0.5, 1.0))
            values.append(1e-3 * value if name.startswith("Im") else value)
        return np.array(values)

    return of


@pytest.fixture(scope="module")
def run() -> Run:
    def make(
        model: RobotModel,
        values: np.ndarray,
        *,
        seed: int = 0,
        samples: int = 3000,
        noise: float = 0.5,
        payload: bool = False,
    ) -> SmoothedSignals:
        from dynamics.terms.conditions import Conditions

        random = np.random.default_rng(seed)
        n = model.chain.n
        time_s = STEP_S * np.arange(samples, dtype=np.float64)
        omega = 2.0 * np.pi / 10.0 * np.arange(1, 6)
        sine, cosine = 0.25 * random.normal(size=(2, 5, n))
        s, c = np.sin(np.outer(time_s, omega)), np.cos(np.outer(time_s, omega))
        q, v = s @ sine + c @ cosine, (c * omega) @ sine - (s * omega) @ cosine
        a = -(s * omega**2) @ sine - (c * omega**2) @ cosine
        tau = torque(model, q, v, a, values, Conditions(payload=payload))
        return SmoothedSignals(
            joint_names=model.joint_names,
            time_s=time_s,
            position=q,
            velocity=v,
            acceleration=a,
            torque_nm=tau + noise * random.normal(size=tau.shape),
            segment=np.zeros(samples, dtype=np.int64),
            sample_period_s=STEP_S,
            cutoff_hz=10.0,
        )

    return make


def test_ordinary_least_squares_equals_that_of_all_rows_stacked(robot, truth, run) -> None:
    model = RobotModel.from_description(robot)
    signals = run(model, truth(model))
    found = fit_smoothed(
        robot, [signals], EstimationOptions(weighting="ls", standstill_rad_s=0.0)
    ).estimate()
    phi = found.base.columns(
        regressor(model, signals.position, signals.velocity, signals.acceleration)
    )
    expected = np.linalg.lstsq(
        phi.reshape(-1, len(found.base)), signals.torque_nm.ravel(), rcond=None
    )[0]
    np.testing.assert_allclose(found.values, expected, rtol=1e-6, atol=1e-8)


def test_weighting_prefers_joints_with_less_noise(robot, truth, run) -> None:
    model = RobotModel.from_description(robot)
    signals = run(model, truth(model), noise=0.1)
    loud = np.array([1.0, 100.0, 1.0]) * np.random.default_rng(5).normal(size=(3000, 3))
    noisy = replace(signals, torque_nm=signals.torque_nm + loud)
    expected = base_parameters(model).from_standard(truth(model))
    errors = {
        weighting: np.abs(
            fit_smoothed(robot, [noisy], EstimationOptions(weighting=weighting)).estimate().values
            - expected
        )
        for weighting in ("ml", "ls")
    }
    assert np.median(errors["ml"] / errors["ls"]) < 0.5


def test_huber_weighting_limits_gross_errors(robot, truth, run) -> None:
    model = RobotModel.from_description(robot)
    signals = run(model, truth(model))
    random = np.random.default_rng(1)
    hit = random.random(signals.torque_nm.shape) < 0.03
    knocked = replace(signals, torque_nm=signals.torque_nm + np.where(hit, 300.0, 0.0))
    clean = fit_smoothed(robot, [signals]).estimate()
    robust = fit_smoothed(robot, [knocked], EstimationOptions(weighting="huber")).estimate()
    plain = fit_smoothed(robot, [knocked]).estimate()
    off = [np.abs(e.values - clean.values) / clean.sigma for e in (robust, plain)]
    assert np.median(off[0]) < 3.0
    assert np.median(off[1]) > 3.0 * np.median(off[0])


class TestNonlinearParameters:
    def test_a_stribeck_speed_agrees_with_a_solver_of_the_full_problem(
        self, robot, truth, run
    ) -> None:
        arm = friction(robot, ("coulomb", "viscous", "stribeck"))
        model = RobotModel.from_description(arm).with_nonlinear([0.08, 0.15, 0.1])
        signals = run(model, truth(model), samples=1500)
        found = fit_smoothed(
            arm, [signals], EstimationOptions(standstill_rad_s=0.0, weighting="ls")
        ).estimate()
        base = found.base
        q, v, a = signals.position, signals.velocity, signals.acceleration

        def residual(x: np.ndarray) -> np.ndarray:
            phi = base.columns(regressor(model.with_nonlinear(x[-3:]), q, v, a))
            return (phi @ x[:-3] - signals.torque_nm).ravel()

        start = np.concatenate([found.values * 1.05, [0.09, 0.12, 0.09]])
        size = np.maximum(np.abs(start), 1e-3)
        judge = least_squares(residual, start, x_scale=size, xtol=1e-12, ftol=1e-12)
        assert found.options.nonlinear is not None
        np.testing.assert_allclose(found.options.nonlinear, judge.x[-3:], rtol=2e-3)
        inside = (
            np.abs(np.array(found.options.nonlinear) - [0.08, 0.15, 0.1])
            < 3.0 * found.nonlinear_sigma
        )
        assert inside.all()

    def test_efficiencies_and_load_friction_are_found(self, robot, truth, run) -> None:
        lossy = friction(robot, ("coulomb", "viscous"), efficiency=0.95)
        loaded = friction(robot, ("coulomb", "viscous", "load"))
        for arm, shape in ((lossy, [0.9, 0.8, 0.85]), (loaded, [0.05, 0.1, 0.08])):
            # Without rotors: their inertia merges with the links, and gears do not transmit it.
            options = ModelOptions(rotors=False)
            model = options.build(arm).with_nonlinear(shape)
            signals = run(model, truth(model), samples=6000)
            found = fit_smoothed(arm, [signals], EstimationOptions(model=options)).estimate()
            assert found.options.nonlinear is not None
            off = np.abs(np.array(found.options.nonlinear) - shape) / found.nonlinear_sigma
            # Skip axis 1: it is vertical; without gravity its data hardly show losses.
            assert (off[1:] < 3.0).all()
            assert np.abs(np.array(found.options.nonlinear) - shape)[1:].max() < 0.02

    def test_a_term_with_zero_effect_does_not_change_the_others(self, robot, truth, run) -> None:
        plain = RobotModel.from_description(friction(robot, ("coulomb", "viscous")))
        signals = run(plain, truth(plain))
        arm = friction(robot, ("coulomb", "viscous", "stribeck"))
        found = fit_smoothed(arm, [signals]).estimate()
        q, v, a = signals.position, signals.velocity, signals.acceleration
        error = predict(found, q, v, a) - torque(plain, q, v, a, truth(plain))
        assert np.sqrt(np.mean(error[np.abs(v) >= 0.02] ** 2)) < 0.1


def prior_of_known(base: BaseParameters, known: dict[str, tuple[float, float]]) -> Prior:
    """Return values and sigmas of all standard parameters; those not in `known` are unknown."""
    values = np.zeros(len(base.standard_names))
    sigmas = np.full(len(values), np.inf)
    for name, (value, sigma) in known.items():
        index = base.standard_names.index(name)
        values[index], sigmas[index] = value, sigma
    return values, sigmas


class TestPrior:
    def test_an_uninformative_prior_changes_nothing(self, robot, truth, run) -> None:
        model = RobotModel.from_description(robot)
        signals = [run(model, truth(model))]
        nothing = prior_of_known(base_parameters(model), {})
        np.testing.assert_allclose(
            fit_smoothed(robot, signals, EstimationOptions(prior=nothing)).estimate().values,
            fit_smoothed(robot, signals).estimate().values,
        )

    def test_a_parameter_can_be_fixed(self, robot, truth, run) -> None:
        model = RobotModel.from_description(robot)
        signals = [run(model, truth(model))]
        known = prior_of_known(base_parameters(model), {"fc_axis1": (33.0, 0.0)})
        found = fit_smoothed(robot, signals, EstimationOptions(prior=known)).estimate()
        index = found.base.names.index("fc_axis1")
        assert found.values[index] == pytest.approx(33.0, abs=1e-6)
        assert np.sqrt(found.covariance_residual[index, index]) < 1e-6

    def test_the_result_is_the_weighted_mean_of_prior_and_measurement(
        self, robot, truth, run
    ) -> None:
        model = RobotModel.from_description(robot)
        signals = [run(model, truth(model))]
        free = fit_smoothed(robot, signals).estimate()
        index = free.base.names.index("fv_axis2")
        sigma = float(np.sqrt(free.covariance_residual[index, index]))
        value = float(free.values[index])
        prior = prior_of_known(free.base, {"fv_axis2": (value + 2.0 * sigma, sigma)})
        found = fit_smoothed(robot, signals, EstimationOptions(prior=prior)).estimate()
        assert found.values[index] == pytest.approx(value + sigma, abs=0.02 * sigma)


def test_runs_with_and_without_payload_identify_it(robot, truth, run) -> None:
    options = ModelOptions(payload=True)
    model = options.build(robot)
    values = truth(model)
    load = model.parameter_groups["payload"]
    values[load] = [5.0, 0.5, 0.1, 1.0, 0.4, 0.0, -0.1, 0.5, 0.0, 0.2]
    signals = [
        run(model, values, seed=seed, payload=loaded) for seed, loaded in ((1, False), (2, True))
    ]
    found = fit_smoothed(
        robot, signals, EstimationOptions(model=options), payload=[False, True]
    ).estimate()
    expected = found.base.from_standard(values)
    off = np.abs(found.values - expected) / found.sigma
    payload = [name.endswith("L") for name in found.base.names]
    assert sum(payload) >= 4
    assert (off[payload] < 3.5).all()


def test_the_model_file_describes_every_term(robot, truth, run) -> None:
    arm = friction(robot, ("coulomb", "viscous", "stribeck"))
    model = RobotModel.from_description(arm)
    found = fit_smoothed(arm, [run(model, truth(model))]).estimate()
    assert found.options.build(arm).nonlinear_values == pytest.approx(found.options.nonlinear)
