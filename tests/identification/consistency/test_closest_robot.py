"""Physically consistent robots: positive definite pseudo-inertias, closest to an estimate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import ImportMap, RowRange
from acquisition.processing.smoothing import smooth_nonperiodic
from benchmarks.consistency import with_noise
from config.errors import EstimationError
from config.load import load_bundled_or_path, load_robot
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, regressor, torque
from dynamics.terms.conditions import Conditions
from identification.consistency.closest_robot import NOMINAL_WEIGHT, find_closest
from identification.consistency.constraints import not_negative
from identification.consistency.metric import jackknife_metric
from identification.consistency.nominal_robot import nominal_parameters
from identification.consistency.pseudo_inertia import pseudo_inertia
from identification.consistency.rigid_body import LinkBody
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_signals import fit_smoothed
from identification.model.base_parameters import base_parameters
from identification.model.options import ModelOptions
from tests.builders.raised_codes import raises_code

Array = NDArray[np.float64]
ROBOTS = ("ir361", "ur10e")


def point_masses(seed: int, count: int = 12) -> tuple[Array, Array]:
    """Return masses (count,) in kg and positions (count, 3) in m of point masses."""
    random = np.random.default_rng(seed)
    return random.uniform(0.2, 1.0, count), random.normal(0.0, 0.2, (count, 3))


def body_of(masses: Array, places: Array) -> Array:
    """Return the ten parameters of point masses, from their definition."""
    inertia = sum(
        m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, places, strict=True)
    )
    return np.array([masses.sum(), *(masses @ places), *np.asarray(inertia)[np.triu_indices(3)]])


def robot_of_points(model: RobotModel, robot: RobotDescription, seed: int) -> Array:
    """Return parameters of a physically consistent robot that is as large as the nominal one."""
    random = np.random.default_rng(seed)
    nominal, sigmas = nominal_parameters(model, robot)
    theta = sigmas * random.uniform(0.05, 1.0)
    for link in range(model.chain.n):
        part = slice(10 * link, 10 * link + 10)
        body = LinkBody.of(nominal[part])
        masses, places = point_masses(100 * seed + link)
        masses *= body.mass_kg * random.uniform(0.7, 1.3) / masses.sum()
        extent = np.sqrt(body.principal_moments_kg_m2[2] / body.mass_kg)
        theta[part] = body_of(masses, body.centre_m + places * extent / 0.2)
    return theta


def estimate_near(
    truth: Array, robot: RobotDescription, noise_nm: float, seed: int, options: ModelOptions
) -> Estimate:
    """Return base parameters of a robot with errors as from torque noise."""
    model = options.build(robot)
    base = base_parameters(model)
    random = np.random.default_rng(seed)
    q, v, a = random.normal(0.0, np.array([1.5, 1.0, 3.0])[:, None, None], (3, 60, model.chain.n))
    phi = np.vstack(
        [
            base.columns(regressor(model, q, v, a, Conditions(payload=loaded))).reshape(
                -1, len(base)
            )
            for loaded in (False, True)
        ]
    )
    return with_noise(robot, options, base, truth, phi, noise_nm, random)


Make = Callable[..., tuple[Estimate, Array]]


@pytest.fixture(scope="module")
def make() -> Make:
    def of(
        name: str, noise_nm: float, seed: int = 0, options: ModelOptions | None = None
    ) -> tuple[Estimate, Array]:
        robot, options = load_robot(name), options or ModelOptions()
        model = options.build(robot)
        truth = robot_of_points(model, robot, 7)
        if "payload" in model.parameter_groups:
            truth[model.parameter_groups["payload"]] = body_of(*point_masses(99))
        return estimate_near(truth, robot, noise_nm, seed, options), truth

    return of


@given(st.integers(0, 10_000))
@settings(max_examples=25)
def test_a_pseudo_inertia_is_the_integral_over_the_mass(seed: int) -> None:
    masses, places = point_masses(seed)
    ends = np.column_stack([places, np.ones(len(places))])
    expected = (ends.T * masses) @ ends
    np.testing.assert_allclose(pseudo_inertia(body_of(masses, places)), expected, atol=1e-12)


@given(st.integers(0, 10_000))
@settings(max_examples=25)
def test_inertia_about_the_centre_agrees_with_pinocchio(seed: int) -> None:
    body = body_of(*point_masses(seed))
    link = LinkBody.of(body)
    judge = pin.Inertia.FromDynamicParameters(body[[0, 1, 2, 3, 4, 5, 7, 6, 8, 9]])
    assert link.is_consistent
    assert link.mass_kg == pytest.approx(judge.mass)
    np.testing.assert_allclose(link.centre_m, judge.lever, atol=1e-12)
    np.testing.assert_allclose(link.inertia_kg_m2, judge.inertia, atol=1e-12)
    moments = np.linalg.eigvalsh(judge.inertia)
    np.testing.assert_allclose(link.principal_moments_kg_m2, moments, atol=1e-12)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_nominal_robot_is_physically_consistent(name: str) -> None:
    robot = load_robot(name)
    for known in (robot, robot.model_copy(update={"cad": None})):
        model = RobotModel.from_description(known, payload=True)
        values, sigmas = nominal_parameters(model, known)
        bodies = values[: 10 * model.chain.n].reshape(-1, 10)
        assert all(LinkBody.of(body).is_consistent for body in bodies)
        assert np.all(np.isfinite(sigmas))
        assert np.all(sigmas > 0.0)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_consistent_estimate_is_unchanged(make: Make, name: str) -> None:
    estimate, _ = make(name, 1e-3)
    result = find_closest(estimate)
    assert np.max(np.abs(result.moved_sigmas)) < 0.01
    assert result.test.p_value > 0.999


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("noise_nm", [0.3, 3.0, 30.0])
def test_the_result_is_consistent_for_any_noise(make: Make, name: str, noise_nm: float) -> None:
    estimate, truth = make(name, noise_nm)
    result = find_closest(estimate)
    assert all(link.is_consistent for link in result.links)
    bodies = result.standard_values[: 10 * len(result.links)].reshape(-1, 10)
    assert np.min(np.linalg.eigvalsh(pseudo_inertia(bodies))) > 0.0
    braking = not_negative(estimate.model, estimate.robot)
    assert np.min(braking @ result.standard_values) > -1e-9
    # The truth is consistent too, so the closest consistent robot is not farther away.
    sigma, factor = jackknife_metric(estimate)
    base = estimate.base.from_standard(truth)
    error, found = (
        np.linalg.solve(factor, (values - estimate.values) / sigma)
        for values in (base, result.base_values)
    )
    centre, scale = nominal_parameters(estimate.model, estimate.robot)
    pull = NOMINAL_WEIGHT * np.sum(((truth - centre) / scale) ** 2)
    assert found @ found <= error @ error + pull


def test_its_standard_parameters_give_the_torques_of_its_base_parameters(make: Make) -> None:
    estimate, _ = make("ur10e", 3.0)
    result = find_closest(estimate)
    q, v, a = np.random.default_rng(1).normal(size=(3, 30, 6))
    model = estimate.model
    by_base = estimate.base.columns(regressor(model, q, v, a)) @ result.base_values
    by_standard = torque(model, q, v, a, result.standard_values)
    np.testing.assert_allclose(by_standard, by_base, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("name", ROBOTS)
def test_no_consistent_robot_is_closer(make: Make, name: str) -> None:
    # Convex problem: at the optimum the cost decreases towards no feasible point.
    estimate, truth = make(name, 10.0)
    result = find_closest(estimate)
    model, base = estimate.model, estimate.base
    centre, scale = nominal_parameters(model, estimate.robot)
    information = np.linalg.inv(estimate.covariance_jackknife)
    theta = result.standard_values
    slope = base.combination.T @ information @ (result.base_values - estimate.values)
    slope += NOMINAL_WEIGHT * (theta - centre) / scale**2
    others = [robot_of_points(model, estimate.robot, seed) for seed in range(40)]
    others += [np.where(np.arange(len(theta)) < 10 * model.chain.n, o, theta) for o in others]
    for other in [truth, *others]:
        assert slope @ (other - theta) > -1e-3


def test_nonlinear_friction_dissipates_at_every_speed(make: Make) -> None:
    options = ModelOptions(friction_terms=("coulomb", "viscous", "cube_root", "offset"))
    estimate, _ = make("ir361", 60.0, 3, options)
    result = find_closest(estimate)
    names = estimate.model.parameter_names
    for joint in estimate.robot.joints:
        speed = np.linspace(0.05, 1.0, 50) * joint.limits.velocity
        value = {
            term: result.standard_values[names.index(f"{term}_{joint.name}")]
            for term in ("fc", "fv", "fcr")
        }
        friction = value["fc"] + value["fv"] * speed + value["fcr"] * np.cbrt(speed)
        assert np.min(friction) > -1e-3


def test_a_payload_is_physically_consistent_too(make: Make) -> None:
    estimate, _ = make("ir361", 30.0, 2, ModelOptions(payload=True))
    result = find_closest(estimate)
    body = result.standard_values[estimate.model.parameter_groups["payload"]]
    assert LinkBody.of(body).is_consistent


def test_a_short_recording_with_singular_intervals_has_a_metric(make: Make) -> None:
    estimate, _ = make("ir361", 3.0)
    values, vectors = np.linalg.eigh(estimate.covariance_jackknife)
    values[:5] = 0.0
    singular = (vectors * values) @ vectors.T
    _, factor = jackknife_metric(replace(estimate, covariance_jackknife=singular))
    assert np.linalg.cond(factor) < 1e6
    with raises_code(EstimationError, "RID-MODEL-UNSOUND"):
        jackknife_metric(
            replace(estimate, covariance_jackknife=singular, covariance_residual=-singular)
        )


def test_the_ur10e_is_consistent_within_its_intervals(real_robot: Path) -> None:
    layout = load_bundled_or_path("ur10e_31", "maps", ImportMap)
    layout = layout.model_copy(update={"rows": RowRange(first=355, last=5090)})
    recording = import_csv(real_robot / "ur-20_02_12-50sec_12harm.csv", layout)[0]
    estimate = fit_smoothed(load_robot("ur10e"), [smooth_nonperiodic(recording, 9.4)]).estimate()
    free = estimate.base.names.index("Ixx5")
    assert estimate.values[free] < 0.0  # physically impossible
    result = find_closest(estimate)
    assert all(link.is_consistent for link in result.links)
    assert result.test.p_value > 0.3
    assert np.max(np.abs(result.moved_sigmas)) < 2.0
    assert 10.0 < result.links[1].mass_kg < 17.0
