"""Filters of recorded torques are found without a choice of the model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import bilinear, filtfilt, lfilter

from acquisition.processing.smoothing import smooth_nonperiodic
from benchmarks.honest_choice import BAND_HZ, DURATION_S, FRICTIONS, Case, recording
from benchmarks.known_arms import ARMS, STEP_S, drive
from config.arrays import FloatArray
from identification.estimation.options import EstimationOptions
from identification.validation.torque_filters import channel_findings

Filter = Callable[[FloatArray], FloatArray]
ROBOT = ARMS["three"].description()
JOINTS = list(ROBOT.joint_names)


def first_order(corner_hz: float) -> tuple[FloatArray, FloatArray]:
    omega = 2.0 * np.pi * corner_hz
    b, a = bilinear([omega], [1.0, omega], 1.0 / STEP_S)
    return np.asarray(b), np.asarray(a)


def lag(torque_nm: FloatArray, corner_hz: float) -> FloatArray:
    start = torque_nm[0]
    return np.asarray(lfilter(*first_order(corner_hz), torque_nm - start, axis=0) + start)


def zero_phase(torque_nm: FloatArray, corner_hz: float) -> FloatArray:
    return np.asarray(filtfilt(*first_order(corner_hz), torque_nm, axis=0))


def findings(filtered: Filter, friction: str, known: tuple[str, ...] = ()) -> tuple[str, ...]:
    driven = drive("three", "points", 430, FRICTIONS[friction], DURATION_S)
    changed = replace(driven, torque_nm=filtered(driven.torque_nm))
    run, _ = recording(Case("three", friction, "none", 43), changed, 0, ROBOT)
    signals = [smooth_nonperiodic(run, BAND_HZ)]
    return channel_findings(ROBOT, signals, EstimationOptions(), known)


@pytest.mark.parametrize("effect", [lag, zero_phase])
def test_a_filter_of_all_torques_is_named_with_its_frequency(
    effect: Callable[[FloatArray, float], FloatArray],
) -> None:
    (sentence,) = findings(lambda torque_nm: effect(torque_nm, 5.0), "plain")
    for name in JOINTS:
        shown_hz = float(sentence.split(f"{name} ")[1].split(" Hz")[0])
        assert shown_hz == pytest.approx(5.0, rel=0.25)


@pytest.mark.parametrize("friction", ["plain", "both"])
def test_a_torque_without_a_filter_is_no_finding(friction: str) -> None:
    assert findings(np.asarray, friction) == ()


def test_joints_of_another_finding_are_not_repeated() -> None:
    (sentence,) = findings(partial(zero_phase, corner_hz=5.0), "plain", (JOINTS[0],))
    assert JOINTS[0] not in sentence
    assert JOINTS[1] in sentence


@pytest.mark.parametrize("delay_ms", [12.0, -8.0])
def test_a_delay_that_a_bus_can_cause_is_named(delay_ms: float) -> None:
    def delayed(torque_nm: FloatArray) -> FloatArray:
        time_s = STEP_S * np.arange(len(torque_nm))
        return np.asarray(
            CubicSpline(time_s, torque_nm)(np.clip(time_s - 1e-3 * delay_ms, 0.0, time_s[-1]))
        )

    (sentence,) = findings(delayed, "plain")
    for name in JOINTS:
        shown_ms = float(sentence.split(f"{name} ")[1].split(" ms")[0])
        assert shown_ms == pytest.approx(delay_ms, abs=1.5)
