"""Torques with few digits: their steps, and intervals that contain their effect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from acquisition.processing.smoothing import smooth_nonperiodic
from acquisition.recording.recording import Recording
from benchmarks.honest_choice import BAND_HZ, Case, recording
from benchmarks.known_arms import ARMS, Friction, drive
from config.arrays import FloatArray
from identification.accuracy.rounded_torques import RoundedTorques, torque_steps
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_signals import fit_smoothed

DURATION_S = 20.0
ROBOT = ARMS["three"].description()


@cache
def sound() -> Recording:
    driven = drive("three", "sines", 1, Friction(), DURATION_S)
    return recording(Case("three", "plain", "none", 1), driven, 0, ROBOT)[0]


def rounded(steps: FloatArray) -> Recording:
    """Return a recording whose torques are multiples of `steps` [N m]; 0 keeps a torque."""
    torque, size = sound().torque_nm, np.where(steps > 0.0, steps, 1.0)
    return replace(sound(), torque_nm=np.where(steps > 0.0, np.round(torque / size) * size, torque))


def estimate(runs: Sequence[Recording]) -> Estimate:
    return fit_smoothed(ROBOT, [smooth_nonperiodic(run, BAND_HZ) for run in runs]).estimate()


def steps_of_range(share: float) -> FloatArray:
    return share * np.ptp(sound().torque_nm, axis=0) * np.array([0.0, 0.0, 1.0])


def test_the_step_of_each_torque_is_found() -> None:
    steps = np.ptp(sound().torque_nm, axis=0) * np.array([0.0, 0.02, 0.2])
    np.testing.assert_allclose(torque_steps(rounded(steps)), steps)
    assert RoundedTorques.of(ROBOT, [sound()], BAND_HZ) is None


@pytest.mark.parametrize("share", [0.02, 0.1])
def test_the_intervals_contain_the_effect(share: float) -> None:
    run = rounded(steps_of_range(share))
    found = RoundedTorques.of(ROBOT, [run], BAND_HZ)
    assert found is not None
    narrow = estimate([run])
    wide, found = found.widen(narrow, [run], estimate)
    away = np.abs(narrow.values - estimate([sound()]).values)
    assert np.max(away / wide.sigma) < 3.0
    assert found.is_material == (found.widening >= 1.2)
    assert found.widening == pytest.approx(np.max(wide.sigma / narrow.sigma))


def test_an_effect_that_is_not_known_is_always_reported() -> None:
    found = RoundedTorques.of(ROBOT, [rounded(steps_of_range(0.25))], BAND_HZ)
    assert found is not None
    assert found.widening == 1.0
    assert found.is_coarse.tolist() == [[False, False, True]]
    assert found.is_material
