"""Torques that change in the course of a recording are found if they change the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from acquisition.processing.smoothing import SmoothedSignals, smooth_nonperiodic
from acquisition.recording.recording import Recording
from benchmarks.honest_choice import BAND_HZ, Case, recording
from benchmarks.known_arms import ARMS, Friction, drive
from config.arrays import FloatArray
from identification.accuracy.torque_drift import (
    FEWEST_PARTS,
    DriftKind,
    TorqueDrift,
    find_torque_drifts,
)
from identification.estimation.fitted_signals import fit_smoothed

DURATION_S = 40.0
JOINT = 1


@cache
def sound(seed: int) -> Recording:
    driven = drive("three", "points", seed, Friction(), DURATION_S)
    return recording(Case("three", "plain", "none", seed), driven, 0, ARMS["three"].description())[
        0
    ]


def drifting(kind: DriftKind, change: float, seed: int = 1) -> Recording:
    """Return a recording in which part of a joint's torque changes in proportion to time."""
    run = sound(seed)
    torque, speed = run.torque_nm.copy(), np.gradient(run.position, axis=0)
    since = (run.time_s - run.time_s[0]) / (run.time_s[-1] - run.time_s[0]) - 0.5
    parts: dict[DriftKind, FloatArray] = {
        DriftKind.OFFSET: np.ones_like(torque),
        DriftKind.FRICTION: np.sign(speed),
        DriftKind.FACTOR: torque,
    }
    torque[:, JOINT] += change * since * parts[kind][:, JOINT]
    return replace(run, torque_nm=torque)


def drifts(runs: Sequence[Recording], recordings: Sequence[int] = (0,)) -> tuple[TorqueDrift, ...]:
    signals: list[SmoothedSignals] = [smooth_nonperiodic(run, BAND_HZ) for run in runs]
    fitted = fit_smoothed(ARMS["three"].description(), signals)
    return find_torque_drifts(fitted, fitted.estimate().sigma, recordings)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_sound_torques_do_not_drift(seed: int) -> None:
    assert drifts([sound(seed)]) == ()


@pytest.mark.parametrize(
    ("kind", "change"),
    [(DriftKind.OFFSET, 3.0), (DriftKind.FACTOR, 0.05), (DriftKind.FRICTION, -3.0)],
)
def test_a_drift_is_found_with_its_kind_and_size(kind: DriftKind, change: float) -> None:
    (found,) = drifts([drifting(kind, change)])
    assert (found.joint, found.kind, found.recording) == ("joint2", kind, 0)
    assert found.change == pytest.approx(change, rel=0.1)
    assert found.sigmas > 1.0 or found.end_sigmas > 2.0


def test_of_two_recordings_the_one_that_drifts_is_named() -> None:
    runs = [sound(2), drifting(DriftKind.OFFSET, 5.0)]
    assert {each.recording for each in drifts(runs, (0, 1))} == {1}


def test_stretches_of_one_recording_share_its_time() -> None:
    whole = drifting(DriftKind.OFFSET, 3.0)
    half = len(whole) // 2
    runs = [whole.part(slice(0, half)), whole.part(slice(half, None))]
    (found,) = drifts(runs, (0, 0))
    assert found.change == pytest.approx(3.0, rel=0.1)


def test_a_short_recording_shows_no_drift() -> None:
    whole = drifting(DriftKind.OFFSET, 3.0)
    rows = int(np.searchsorted(whole.time_s, FEWEST_PARTS - 1.5))
    assert drifts([whole.part(slice(0, rows))]) == ()
