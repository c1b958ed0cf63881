"""Warming of joints is detected from their friction, but only if the data show the warming."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from dynamics.terms.conditions import Conditions
from identification.equations.warming import Warming
from identification.estimation.estimate import Estimate, predict
from identification.estimation.file import read_estimate, write_estimate
from identification.estimation.fitted_signals import fit_smoothed
from identification.validation.warming_choice import choose_warming
from tests.builders.presliding_arm import arm
from tests.builders.warming_arm import (
    COULOMB_NM,
    STEP_S,
    VISCOUS_NM_S,
    recording,
    settled_factor,
)

TIME_CONSTANTS_S = (60.0, None, 120.0)
COPPER_W = 5.0


@pytest.fixture(scope="module")
def warm() -> SmoothedSignals:
    return recording(300.0, TIME_CONSTANTS_S, copper_w=COPPER_W)


@pytest.fixture(scope="module")
def found(warm: SmoothedSignals) -> Warming:
    """Warming of axes 1 and 3 by friction and copper losses; axis 2 does not warm up."""
    warming = choose_warming(arm(), [warm])
    assert warming is not None
    return warming


def fitted(warming: Warming, signals: SmoothedSignals) -> Estimate:
    robot = warming.robot(arm())
    estimate = fit_smoothed(robot, [warming.with_temperatures(robot, signals)]).estimate()
    return replace(estimate, warming=warming)


def error_nm(estimate: Estimate, signals: SmoothedSignals) -> FloatArray:
    """Return the RMS error [N m] of each joint while it moves."""
    motion = (signals.position, signals.velocity, signals.acceleration)
    conditions = None
    if estimate.warming is not None:
        warmed = estimate.warming.with_temperatures(estimate.robot, signals)
        conditions = Conditions(temperature_k=warmed.temperature_k)
    error = signals.torque_nm - predict(estimate, *motion, conditions)
    moving = np.abs(signals.velocity) > 0.05
    return np.asarray(np.sqrt(np.sum(error**2 * moving, axis=0) / moving.sum(axis=0)))


def test_exactly_the_warming_joints_are_found(found: Warming) -> None:
    assert found.joints.tolist() == [True, False, True]
    terms = ["temperature" in joint.friction for joint in found.robot(arm()).joints]
    assert terms == [True, False, True]


def test_the_time_constant_includes_the_feedback_of_falling_friction(
    found: Warming, warm: SmoothedSignals
) -> None:
    """With heat P (1 - k x), a temperature rise x settles 1 + k P R times faster than without k."""
    factor = settled_factor(warm, TIME_CONSTANTS_S)
    for joint in (0, 2):
        motor_s = TIME_CONSTANTS_S[joint]
        assert motor_s is not None
        expected_s = motor_s * factor[joint]
        off_s = abs(found.time_constant_s[joint] - expected_s)
        assert off_s < 3.0 * found.time_constant_sigma_s[joint] + 0.1 * expected_s


def test_another_recording_is_predicted_better(found: Warming, warm: SmoothedSignals) -> None:
    other = recording(240.0, TIME_CONSTANTS_S, seed=1, copper_w=COPPER_W)
    plain = error_nm(fit_smoothed(arm(), [warm]).estimate(), other)
    better = error_nm(fitted(found, warm), other)
    assert np.all(better[[0, 2]] < 0.75 * plain[[0, 2]])
    assert better[1] == pytest.approx(plain[1], rel=0.02)


@pytest.mark.parametrize(("seconds", "seed"), [(40.0, 1), (90.0, 2), (90.0, 3), (200.0, 4)])
def test_a_robot_that_does_not_warm_up_is_not_reported(seconds: float, seed: int) -> None:
    assert choose_warming(arm(), [recording(seconds, (None, None, None), seed=seed)]) is None


def test_measured_temperatures_are_not_replaced(warm: SmoothedSignals) -> None:
    measured = replace(warm, temperature_k=np.full(warm.position.shape, 300.0))
    assert choose_warming(arm(), [measured]) is None


def test_rise_and_slope_follow_from_the_friction_power() -> None:
    signals = recording(30.0, (None, None, None))
    constants_s = np.full(3, 12.0)
    still = Warming(constants_s, np.zeros(3), np.full(3, COULOMB_NM), np.full(3, VISCOUS_NM_S))
    rise = still.with_temperatures(arm(), signals).temperature_k
    assert rise is not None
    speed = np.abs(signals.velocity)
    power_w = (COULOMB_NM + VISCOUS_NM_S * speed) * speed
    slow, expected = np.zeros(3), np.empty_like(rise)
    for i, heat in enumerate(power_w):
        expected[i] = slow
        slow = slow + STEP_S / 12.0 * (heat - slow)
    reference = np.array([joint.reference_temperature_k for joint in arm().joints])
    np.testing.assert_allclose(rise - reference, expected, atol=2e-3 * expected.max())
    longer = (
        replace(still, time_constant_s=constants_s + 1e-4)
        .with_temperatures(arm(), signals)
        .temperature_k
    )
    slope = still.with_temperature_slopes(arm(), signals).temperature_k
    assert longer is not None
    assert slope is not None
    np.testing.assert_allclose(slope - reference, (longer - rise) / 1e-4, atol=1e-4)


def test_a_joint_cools_during_a_gap() -> None:
    signals = recording(30.0, (None, None, None))
    half = len(signals) // 2
    late = signals.time_s + np.where(np.arange(len(signals)) < half, 0.0, 120.0)
    gap = replace(signals, time_s=late, segment=(np.arange(len(signals)) >= half).astype(int))
    warming = Warming(np.full(3, 20.0), np.zeros(3), np.full(3, 1.0), np.zeros(3))
    rise = warming.with_temperatures(arm(), gap).temperature_k
    assert rise is not None
    rise = rise - [joint.reference_temperature_k for joint in arm().joints]
    np.testing.assert_allclose(rise[half], np.exp(-(120.0 + STEP_S) / 20.0) * rise[half - 1])


def test_the_file_contains_the_warming_parameters(
    found: Warming, warm: SmoothedSignals, tmp_path: Path
) -> None:
    estimate = fitted(found, warm)
    write_estimate(tmp_path / "model.json", estimate)
    read = read_estimate(tmp_path / "model.json").warming
    assert read is not None
    for name, value in vars(found).items():
        np.testing.assert_array_equal(getattr(read, name), value)
