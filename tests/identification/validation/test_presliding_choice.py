"""Presliding is chosen only if the data show it, and its distance is recovered."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.errors import EstimationError
from dynamics.kernels.presliding import RIGID_SLIP
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_signals import fit_smoothed
from identification.validation.presliding_choice import PreslidingChoice, choose_presliding
from tests.builders.presliding_arm import (
    STEP_S,
    arm,
    dahl,
    iwan,
    motion,
    recording,
    signals_of,
    with_presliding,
)
from tests.builders.raised_codes import raises_code

DISTANCE = 0.02
WAY = motion(40.0, 1)
EXPERIMENTS = [
    pytest.param(40, marks=pytest.mark.slow),
    pytest.param(100, marks=pytest.mark.long),
]


@pytest.fixture(scope="module")
def choice() -> PreslidingChoice:
    """Axis 1 has rigid friction, axis 2 Iwan presliding, axis 3 Dahl presliding."""
    q = WAY[0]
    directions = {1: iwan(q[:, 1], DISTANCE), 2: dahl(q[:, 2], DISTANCE / 3.0)}
    return choose_presliding(arm(), [recording(directions, WAY)])


def test_joints_with_presliding_get_the_term_and_their_distance(choice: PreslidingChoice) -> None:
    first, second, third = choice.distances
    assert first is None
    assert second == pytest.approx(DISTANCE, rel=0.1)
    assert third is not None
    assert 0.3 * DISTANCE < third < 2.0 * DISTANCE
    without, remembering = choice.error_nm
    assert np.all(remembering[1:] < 0.7 * without[1:])


def test_the_chosen_robot_has_the_terms(choice: PreslidingChoice) -> None:
    robot = choice.robot(arm())
    assert [("presliding" in joint.friction) for joint in robot.joints] == [False, True, True]
    assert robot.joints[1].presliding_distance == choice.distances[1]
    assert choice.robot(robot) == robot


def test_the_presliding_fraction_is_1_without_evidence_for_rigid_friction(
    choice: PreslidingChoice,
) -> None:
    assert choice.shares[:2] == (1.0, 1.0)
    assert choice.shares[2] > 0.9, "below 1, because Dahl's law is steeper near the reversal"


def partial_presliding(q: FloatArray, share: float) -> FloatArray:
    """Return the series that replaces sign(v), for a joint with the presliding fraction `share`."""
    return share * iwan(q, DISTANCE) + (1.0 - share) * iwan(q, RIGID_SLIP, elements=1)


def test_a_rigid_fraction_of_friction_is_recovered() -> None:
    q = WAY[0]
    directions = {1: partial_presliding(q[:, 1], 0.4), 2: iwan(q[:, 2], DISTANCE)}
    chosen = choose_presliding(arm(), [recording(directions, WAY)])
    assert chosen.distances[0] is None
    assert chosen.distances[1:] == pytest.approx((DISTANCE, DISTANCE), rel=0.15)
    assert chosen.shares[1] == pytest.approx(0.4, abs=0.06)
    assert chosen.shares[2] == 1.0
    robot = chosen.robot(arm())
    assert robot.joints[1].presliding_share == chosen.shares[1]


def test_a_robot_without_presliding_gets_no_term() -> None:
    assert choose_presliding(arm(), [recording({}, WAY)]).distances == (None, None, None)


def test_a_recording_that_cannot_be_split_is_refused() -> None:
    with raises_code(EstimationError, "RID-RECORDING-SHORT"):
        choose_presliding(arm(), [recording({}, WAY)], folds=1)


@cache
def estimated_distances(seed: int) -> tuple[FloatArray, FloatArray]:
    """Return the estimated presliding distances of axes 2 and 3 and their standard deviations in
    one experiment.
    """
    way = motion(20.0, seed)
    q = way[0]
    directions = {1: iwan(q[:, 1], DISTANCE), 2: iwan(q[:, 2], DISTANCE / 4.0)}
    measured = recording(directions, way, noise_nm=6.0, seed=seed)
    estimate: Estimate = fit_smoothed(with_presliding((1, 2), 0.01), [measured]).estimate()
    return estimate.model.nonlinear_values, estimate.nonlinear_sigma


@cache
def estimated_shares(seed: int) -> tuple[FloatArray, FloatArray]:
    """Return the estimated presliding distance and fraction of axis 2 and their standard deviations
    in one experiment.
    """
    way = motion(40.0, seed)
    measured = recording({1: partial_presliding(way[0][:, 1], 0.5)}, way, noise_nm=6.0, seed=seed)
    robot = with_presliding((1,), 0.01, share=0.7)
    estimate = fit_smoothed(robot, [measured]).estimate()
    return estimate.model.nonlinear_values, estimate.nonlinear_sigma


@pytest.mark.parametrize("experiments", EXPERIMENTS)
def test_two_sigma_cover_the_presliding_fractions(experiments: int) -> None:
    found = [estimated_shares(seed) for seed in range(experiments)]
    values, sigmas = np.array([f[0] for f in found]), np.array([f[1] for f in found])
    assert np.mean(np.abs(values - [DISTANCE, 0.5]) < 2.0 * sigmas) >= 0.9
    assert np.all(np.mean(sigmas, axis=0) < [0.2 * DISTANCE, 0.1])


def add_pause(measured: SmoothedSignals, seconds: float) -> SmoothedSignals:
    """Return a recording that ends with a rest, in which the motors' torques fall by a fifth."""
    rows = round(seconds / STEP_S)

    def resting(values: FloatArray, factor: float) -> FloatArray:
        return np.concatenate([values, np.tile(factor * values[-1], (rows, 1))])

    return signals_of(
        resting(measured.position, 1.0),
        resting(measured.velocity, 0.0),
        resting(measured.acceleration, 0.0),
        resting(measured.torque_nm, 0.8),
    )


def coverage_of_distances(experiments: int) -> tuple[float, FloatArray]:
    found = [estimated_distances(seed) for seed in range(experiments)]
    values, sigmas = np.array([f[0] for f in found]), np.array([f[1] for f in found])
    truth = DISTANCE * np.array([1.0, 0.25])
    return float(np.mean(np.abs(values - truth) < 2.0 * sigmas)), np.mean(sigmas, axis=0)


def test_the_distance_is_within_its_interval() -> None:
    share, sigma = coverage_of_distances(4)
    assert share >= 0.75
    assert np.all(sigma < 0.2 * DISTANCE), "a very wide interval covers every value"


@pytest.mark.parametrize("experiments", EXPERIMENTS)
def test_two_sigma_cover_the_distances(experiments: int) -> None:
    share, _ = coverage_of_distances(experiments)
    assert share >= 0.9


def test_a_pause_has_the_same_weight_for_any_duration() -> None:
    """A minute of rest counts as one observation and not as thousands, so it cannot dominate the
    motion.
    """
    q = WAY[0]
    measured = recording({1: iwan(q[:, 1], DISTANCE)}, WAY)
    robot = with_presliding((1,), 0.01)
    short_rest, long_rest = (
        fit_smoothed(robot, [add_pause(measured, seconds)]).estimate() for seconds in (1.0, 60.0)
    )
    np.testing.assert_allclose(long_rest.values, short_rest.values, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(
        long_rest.model.nonlinear_values, short_rest.model.nonlinear_values, rtol=1e-6
    )
