"""Test of physical consistency: consistent robots pass, impossible parameters fail."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.consistency import border_robots, noisy_estimate, sound_robot
from identification.consistency.closest_robot import check_consistency, cone
from identification.consistency.consistency_test import JudgedParameters, cannot_be_negative
from identification.consistency.metric import jackknife_metric
from identification.estimation.estimate import Estimate

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def estimate() -> Estimate:
    """Return a UR10e's 52 base parameters, exact, with the intervals from noise of 3 N m."""
    noisy = noisy_estimate(0)
    return replace(noisy, values=noisy.base.from_standard(sound_robot(noisy)))


def judged_parameters(estimate: Estimate) -> JudgedParameters:
    base = estimate.base
    return JudgedParameters(
        base.names, base.expressions, estimate.values, *jackknife_metric(estimate)
    )


def below_zero(estimate: Estimate, name: str, sigmas: float) -> Estimate:
    """Return the estimate with one parameter set to the given number of standard deviations below
    zero.
    """
    values, place = estimate.values.copy(), estimate.base.names.index(name)
    values[place] = -sigmas * estimate.sigma[place]
    return replace(estimate, values=values)


@pytest.mark.parametrize("name", ["Im6", "fv_joint3", "fc_joint1", "Izz4"])
def test_one_parameter_at_minus_five_sigma_of_52_is_rejected_and_named(
    estimate: Estimate, name: str
) -> None:
    test = check_consistency(below_zero(estimate, name, 5.0))
    assert not test.is_consistent
    assert test.largest is not None
    assert test.largest.name == name
    assert test.largest.sigmas == pytest.approx(5.0)
    assert test.single_p_value == pytest.approx(test.tested * 2.8665e-7, rel=1e-3)
    assert test.p_value == 2.0 * test.single_p_value


def test_a_parameter_of_either_sign_is_no_violation(estimate: Estimate) -> None:
    for name in ("Ixy2", "sx3", "Iyz6"):
        assert name not in [each.name for each in check_consistency(estimate).violations]
    one_sign = cannot_be_negative(judged_parameters(estimate), cone(estimate))
    either = [n for n, one in zip(estimate.base.names, one_sign, strict=True) if not one]
    assert {"Ixy2", "sx2", "Iyz6", "Ixx5", "sy6"} <= set(either)
    assert {"Izz1", "Izz6", "Im3", "fv_joint6"}.isdisjoint(either)


def test_every_tested_parameter_is_positive_for_possible_robots(estimate: Estimate) -> None:
    one_sign = cannot_be_negative(judged_parameters(estimate), cone(estimate))
    base, random = estimate.base, np.random.default_rng(1)
    for _ in range(20):
        robot = sound_robot(estimate, random)
        rounding = 1e-9 * np.abs(base.combination) @ np.abs(robot)
        assert np.all((base.from_standard(robot) >= -rounding)[one_sign])


@pytest.mark.parametrize("number", range(3))
def test_robots_on_the_boundary_pass(estimate: Estimate, number: int) -> None:
    # True robots without viscous friction, rotor inertia or thickness of links, plus noise.
    _, robot = border_robots(estimate)[number]
    sigma, factor = jackknife_metric(estimate)
    error = sigma * (factor @ np.random.default_rng(number).normal(size=len(sigma)))
    test = check_consistency(replace(estimate, values=estimate.base.from_standard(robot) + error))
    assert test.is_consistent
    assert test.distance is not None


def test_an_impossible_body_is_rejected_although_each_parameter_is_possible(
    estimate: Estimate,
) -> None:
    # Products of inertia may have either sign, but these are too large for the moments.
    values = estimate.values.copy()
    for name in ("Ixy6", "Ixz6", "Iyz6"):
        place = estimate.base.names.index(name)
        values[place] += 15.0 * estimate.sigma[place]
    test = check_consistency(replace(estimate, values=values))
    assert not test.is_consistent
    assert test.refuted == ()
    assert test.distance_p_value is not None
    assert test.distance_p_value < 0.025


def test_the_same_estimate_gives_the_same_result(estimate: Estimate) -> None:
    low = below_zero(estimate, "Im6", 2.0)
    assert check_consistency(low) == check_consistency(low)


def test_few_clusters_give_wider_tails(estimate: Estimate) -> None:
    low = below_zero(estimate, "fv_joint3", 4.0)
    few = check_consistency(replace(low, clusters=6))
    assert few.single_p_value > 10.0 * check_consistency(low).single_p_value


def test_the_faster_projection_has_nearly_the_same_distance(estimate: Estimate) -> None:
    programme = cone(estimate)
    random = np.random.default_rng(0)
    for target in random.normal(scale=3.0, size=(3, len(estimate.values))):
        exact, rough = (
            programme.matrix @ programme.solve(target, exactly=exactly) - target
            for exactly in (True, False)
        )
        assert np.linalg.norm(rough - exact) < 1e-3
