"""Torque and regressor columns are filtered in the same way: the true parameters leave no
residual.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.motion.samples import Phase
from acquisition.processing.periods import average_periods
from acquisition.processing.smoothing import SmoothedSignals, smooth_nonperiodic
from acquisition.recording.recording import Recording
from config.arrays import FloatArray
from dynamics.model.robot_model import RobotModel, torque
from dynamics.terms.conditions import Conditions
from identification.equations.segments import split_recording, thin_rows, unfiltered_period_signals
from identification.equations.time_domain import TimeRun, count_rows, time_blocks
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.model.base_parameters import base_parameters
from identification.validation.model_choice import choose_model
from identification.validation.robot_terms import with_friction
from tests.builders.presliding_arm import CLASSICAL, arm

STEP_S = 0.002
STANDSTILL_RAD_S = 0.02


def quick_reversals(
    duration_s: float = 30.0, step_s: float = STEP_S, seed: int = 1
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return time, q, v and a of sums of sines that never repeat, with up to two reversals per
    second.
    """
    random = np.random.default_rng(seed)
    time_s = np.arange(0.0, duration_s, step_s)
    omega = 2.0 * np.pi * random.uniform(0.1, 1.0, (6, 3))
    size, phase = random.uniform(0.05, 0.2, (6, 3)), random.uniform(0.0, 6.0, (6, 3))
    angle = omega * time_s[:, np.newaxis, np.newaxis] + phase
    q = np.sum(size * np.sin(angle), axis=1)
    v = np.sum(size * omega * np.cos(angle), axis=1)
    return time_s, q, v, -np.sum(size * omega**2 * np.sin(angle), axis=1)


def values_of(model: RobotModel) -> FloatArray:
    values = np.random.default_rng(7).uniform(0.5, 1.0, len(model.parameter_names))
    values[model.parameter_groups["friction"]] = [20.0, 8.0] * 3
    return values


def recording_of(motion: tuple[FloatArray, FloatArray, FloatArray, FloatArray]) -> Recording:
    time_s, q, v, a = motion
    model = RobotModel.from_description(arm())
    return Recording(
        joint_names=arm().joint_names,
        time_s=time_s,
        position=q,
        torque_nm=torque(model, q, v, a, values_of(model)),
        valid=np.ones(len(q), dtype=np.bool_),
        phase=np.full(len(q), Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(len(q)),
        source="cell",
    )


@pytest.fixture(scope="module")
def signals() -> SmoothedSignals:
    return smooth_nonperiodic(recording_of(quick_reversals()), 10.0)


def misfit(signals: SmoothedSignals) -> float:
    """Return the largest residual of the true parameters in the used rows, relative to the
    torque.
    """
    model = RobotModel.from_description(arm())
    base = base_parameters(model)
    beta = base.from_standard(values_of(model))
    worst, largest = 0.0, 0.0
    for block in time_blocks(model, base, [TimeRun(signals, Conditions())], STANDSTILL_RAD_S):
        error = np.abs(block.rhs - block.columns @ beta)[block.use]
        worst, largest = max(worst, float(error.max())), max(largest, np.abs(block.rhs).max())
    return worst / largest


@pytest.mark.parametrize("cutoff_hz", [3.0, 10.0])
def test_the_true_parameters_leave_no_residual(cutoff_hz: float) -> None:
    assert misfit(smooth_nonperiodic(recording_of(quick_reversals()), cutoff_hz)) < 1e-6


def test_only_rows_next_to_a_reversal_are_excluded(signals: SmoothedSignals) -> None:
    model = RobotModel.from_description(arm())
    run = TimeRun(signals, Conditions())
    blocks = list(time_blocks(model, base_parameters(model), [run], STANDSTILL_RAD_S))
    use = np.concatenate([block.use for block in blocks])
    assert len(use) == count_rows(model, run)
    assert 0.7 < use.mean() < 0.95
    moving = np.concatenate([block.moving for block in blocks])
    assert np.all(moving[use])
    assert np.any(moving & ~use)


def test_parts_of_a_recording_use_rows_beyond_their_ends(signals: SmoothedSignals) -> None:
    for part in split_recording(thin_rows(signals), 5):
        assert misfit(part) < 1e-6


def test_friction_is_estimated_without_bias(signals: SmoothedSignals) -> None:
    found = fit_smoothed(arm(), [signals]).estimate()
    values = dict(zip(found.base.names, found.values, strict=True))
    for joint in arm().joint_names:
        assert values[f"fc_{joint}"] == pytest.approx(20.0, rel=1e-5)
        assert values[f"fv_{joint}"] == pytest.approx(8.0, rel=1e-5)


def test_the_choice_of_friction_terms_has_no_bias(signals: SmoothedSignals) -> None:
    chosen = choose_model(arm(), [signals])
    assert [joint.friction for joint in chosen.robot(arm()).joints] == [CLASSICAL] * 3


def test_temperature_is_filtered_with_its_columns() -> None:
    robot = with_friction(arm(), [(*CLASSICAL, "temperature")] * 3)
    motion = quick_reversals()
    model = RobotModel.from_description(robot)
    warmth = np.repeat(298.15 + np.linspace(0.0, 20.0, len(motion[0]))[:, np.newaxis], 3, axis=1)
    truth = np.random.default_rng(7).uniform(0.5, 1.0, len(model.parameter_names))
    truth[model.parameter_groups["friction"]] = [20.0, 8.0, -0.1, -0.05] * 3
    recording = replace(
        recording_of(motion),
        torque_nm=torque(model, *motion[1:], truth, Conditions(temperature_k=warmth)),
        temperature_k=warmth,
    )
    found = fit_smoothed(
        robot, [smooth_nonperiodic(recording, 10.0)], EstimationOptions()
    ).estimate()
    expected = found.base.from_standard(truth)
    friction = [i for i, name in enumerate(found.base.names) if name.startswith("f")]
    np.testing.assert_allclose(found.values[friction], expected[friction], rtol=1e-4)


@pytest.mark.parametrize("rows", [4, 20])
def test_columns_repeat_rows_like_the_torque(rows: int) -> None:
    whole = recording_of(quick_reversals())
    torque = whole.torque_nm.copy()
    torque[:, 1:] = torque[np.arange(len(torque)) // rows * rows, 1:]
    held = smooth_nonperiodic(replace(whole, torque_nm=torque), 10.0)
    assert misfit(held) < 1e-6
    assert misfit(split_recording(thin_rows(held), 3)[1]) < 1e-6
    found = fit_smoothed(arm(), [held]).estimate()
    values = dict(zip(found.base.names, found.values, strict=True))
    for joint in arm().joint_names:
        assert values[f"fc_{joint}"] == pytest.approx(20.0, rel=1e-5)


def test_a_mean_period_has_no_filter_error_at_its_ends() -> None:
    period = 2500
    time_s = STEP_S * np.arange(4 * period, dtype=np.float64)
    omega = 2.0 * np.pi / (period * STEP_S) * np.array([1.0, 2.0, 3.0])
    angle = np.outer(time_s, omega)
    q, v, a = 0.4 * np.sin(angle), 0.4 * omega * np.cos(angle), -0.4 * omega**2 * np.sin(angle)
    whole = replace(
        recording_of((time_s, q, v, a)), sample_period_s=STEP_S, samples_per_period=period
    )
    signals = unfiltered_period_signals(average_periods(whole), 10.0)
    assert misfit(signals) < 1e-5
