"""`benchmarks.judged_rows` separates the causes of a model's error on a run that was not used for
its fit: changed friction, rows near rest, and chance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.processing.smoothing import smooth_nonperiodic
from acquisition.recording.recording import Recording
from benchmarks.honest_choice import BAND_HZ, NOISE, Case, recording
from benchmarks.judged_rows import JudgedErrors, judge_rows
from benchmarks.known_arms import ARMS, Friction, drive
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_signals import fit_smoothed

CASE = Case("three", "plain", "none", 1)
DURATION_S = 14.0


def run_of_arm(seed: int, friction: float = 1.0) -> Recording:
    """Return a recording in which Coulomb and viscous friction are multiplied by `friction`."""
    arm = ARMS["three"]
    driven = drive("three", "points", seed, Friction(), DURATION_S)
    v = driven.velocity
    own = np.array(arm.coulomb) * np.sign(v) + np.array(arm.viscous) * v
    driven = replace(driven, torque_nm=driven.torque_nm + (friction - 1.0) * own)
    return recording(CASE, driven, seed, arm.description())[0]


@pytest.fixture(scope="module")
def estimate() -> Estimate:
    signals = [smooth_nonperiodic(run_of_arm(1), BAND_HZ)]
    return fit_smoothed(ARMS["three"].description(), signals).estimate()


@pytest.fixture(scope="module")
def same(estimate: Estimate) -> JudgedErrors:
    return judge_rows(estimate, run_of_arm(2))


@pytest.fixture(scope="module")
def warmer(estimate: Estimate) -> JudgedErrors:
    return judge_rows(estimate, run_of_arm(2, friction=0.8))


def test_friction_that_changed_between_the_runs_is_separated(
    same: JudgedErrors, warmer: JudgedErrors
) -> None:
    assert np.all(warmer.moving_percent > 1.5 * same.moving_percent)
    np.testing.assert_allclose(warmer.own_friction_percent, same.own_friction_percent, rtol=0.1)


def test_rows_away_from_rest_have_only_the_noise_of_the_torque(same: JudgedErrors) -> None:
    # NOISE is white up to 125 Hz; the low-pass leaves a quarter of its RMS value.
    assert np.all(same.away_percent < 50.0 * NOISE)
    assert np.all(same.moving_percent > 1.5 * same.away_percent)


def test_the_standard_deviation_is_that_of_other_runs(estimate: Estimate) -> None:
    judged = [judge_rows(estimate, run_of_arm(seed, friction=0.8)) for seed in range(2, 8)]
    spread = np.std([each.moving_percent for each in judged], axis=0, ddof=1)
    stated = np.mean([each.sigma_percent for each in judged], axis=0)
    assert 0.5 < np.sqrt(np.mean(spread**2) / np.mean(stated**2)) < 2.0
