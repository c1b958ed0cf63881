"""The running estimate equals, at any time, the estimate from all rows so far."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from acquisition.recording.recording import Recording
from config.errors import EstimationError
from config.load import load_robot
from dynamics.model.robot_model import RobotModel
from dynamics.terms.conditions import Conditions
from identification.equations.segments import single_periods, split_recording
from identification.equations.time_domain import TimeRun
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.running import RunningEstimate
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.identification.conftest import KnownArm

Measure = Callable[..., Recording]
STANDSTILL_RAD_S = 0.02


def run(signals: SmoothedSignals) -> TimeRun:
    return TimeRun(signals, Conditions(temperature_k=None))


def test_the_running_estimate_equals_that_of_all_rows(arm: KnownArm, measure: Measure) -> None:
    periods = list(single_periods(measure(periods=3), 10.0).values())
    running = RunningEstimate.empty(arm.model, STANDSTILL_RAD_S)
    for signals in periods:
        running = running.add(run(signals))
    now = running.current_values()
    whole = fit_smoothed(arm.robot, periods).estimate()
    np.testing.assert_allclose(now.values, whole.values, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(now.residual_nm, whole.residual_nm, rtol=1e-6)


def test_parts_of_a_recording_give_its_total_intervals(arm: KnownArm, measure: Measure) -> None:
    period = single_periods(measure(periods=2), 10.0)[0]
    running = RunningEstimate.empty(arm.model, STANDSTILL_RAD_S)
    for part in split_recording(period, 7):
        running = running.add(run(part))
    now = running.current_values()
    whole = fit_smoothed(arm.robot, [period]).estimate()
    np.testing.assert_allclose(now.values, whole.values, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(now.sigma, whole.sigma, rtol=1e-6)


def test_more_periods_reduce_the_error(arm: KnownArm, measure: Measure) -> None:
    running = RunningEstimate.empty(arm.model, STANDSTILL_RAD_S)
    sigma, error = [], []
    for signals in single_periods(measure(periods=16, noise_nm=5.0), 10.0).values():
        running = running.add(run(signals))
        now = running.current_values()
        sigma.append(np.median(now.sigma))
        error.append(np.sqrt(np.mean(((now.values - arm.base) / now.sigma) ** 2)))
    assert len(running.stretches) == 5, "the number of stretches grows with the number of periods"
    assert sigma[15] < 0.5 * sigma[0]
    assert max(error[1:]) < 3.0


def test_undetermined_parameters_are_named(arm: KnownArm, measure: Measure) -> None:
    running = RunningEstimate.empty(arm.model, STANDSTILL_RAD_S)
    with raises_code(EstimationError, "RID-RECORDING-SHORT"):
        running.current_values()


def test_a_nonlinear_model_is_refused() -> None:
    robot = load_robot("ir361")
    joints = (robot.joints[0].model_copy(update={"efficiency": 0.9}), *robot.joints[1:])
    model = RobotModel.from_description(robot.model_copy(update={"joints": joints}))
    with raises_code(EstimationError, "RID-MODEL-LOAD-FRICTION"):
        RunningEstimate.empty(model, STANDSTILL_RAD_S)
