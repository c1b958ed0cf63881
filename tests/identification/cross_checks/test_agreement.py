"""Cross-checks by energy, single joints and a Kalman filter: coverage, and wrong estimates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from acquisition.processing.smoothing import SmoothedSignals, smooth_nonperiodic
from acquisition.processing.torque_channel import TorqueChannel
from acquisition.recording.recording import Recording
from dynamics.terms.conditions import Conditions
from identification.cross_checks.agreement import CrossMethod, check_method, cross_checks
from identification.equations.segments import single_periods
from identification.equations.time_domain import TimeRun
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_signals import fit_smoothed
from tests.builders.presliding_arm import STEP_S, iwan, motion, recording, with_presliding
from tests.builders.presliding_arm import measured as written

if TYPE_CHECKING:
    from tests.identification.conftest import KnownArm

pytestmark = pytest.mark.slow

Measure = Callable[..., Recording]


def runs_of(signals: list[SmoothedSignals]) -> tuple[TimeRun, ...]:
    return tuple(TimeRun(part, Conditions(temperature_k=None)) for part in signals)


def estimate_and_runs(
    arm: KnownArm,
    measure: Measure,
    seed: int = 0,
    change: Callable[..., Any] | None = None,
    noise_nm: float = 0.2,
) -> tuple[Estimate, tuple[TimeRun, ...]]:
    """Return the estimate from two measured periods, and the periods; `change` modifies them."""
    parts = list(single_periods(measure(seed, periods=2, noise_nm=noise_nm), 10.0).values())
    if change is not None:
        parts = [change(part) for part in parts]
    return fit_smoothed(arm.robot, parts).estimate(), runs_of(parts)


@pytest.mark.parametrize(
    ("method", "seeds"),
    [
        *zip(list(CrossMethod)[:2], (12, 12), strict=True),
        pytest.param(list(CrossMethod)[2], 3, marks=pytest.mark.long),
    ],
)
def test_the_intervals_of_each_cross_check_cover_the_truth(
    arm: KnownArm, measure: Measure, method: CrossMethod, seeds: int
) -> None:
    errors = []
    for seed in range(seeds):
        estimate, runs = estimate_and_runs(arm, measure, seed, noise_nm=2.0)
        other = check_method(method, estimate, runs)
        assert other.agrees, other.sentence
        errors.append((other.values - arm.base) / other.sigma)
    assert np.mean(np.abs(errors) < 2.0) >= 0.85
    assert np.sqrt(np.mean(np.square(errors))) > 0.25, "the intervals are not too wide"


def test_the_energy_check_needs_no_accelerations(arm: KnownArm, measure: Measure) -> None:
    """A filter that attenuates accelerations by a tenth makes the estimated inertias too large."""

    def damped(part: SmoothedSignals) -> SmoothedSignals:
        return replace(part, acceleration=0.9 * part.acceleration)

    estimate, runs = estimate_and_runs(arm, measure, change=damped)
    energies = check_method(CrossMethod.ENERGY, estimate, runs)
    assert not energies.agrees
    assert "accelerations" in energies.sentence
    inertia = int(np.argmax(np.abs(energies.difference)))
    own = abs(energies.values[inertia] - arm.base[inertia])
    assert own < 0.3 * abs(estimate.values[inertia] - arm.base[inertia])
    kalman = check_method(CrossMethod.KALMAN, estimate, runs)
    assert not kalman.agrees
    assert np.abs((kalman.values - arm.base) / kalman.sigma).max() < 4.0


def test_the_single_joint_check_detects_a_wrong_torque_constant(
    arm: KnownArm, measure: Measure
) -> None:
    def scaled(part: SmoothedSignals) -> SmoothedSignals:
        return replace(part, torque_nm=part.torque_nm * [1.0, 1.0, 1.15])

    estimate, runs = estimate_and_runs(arm, measure, change=scaled)
    other = check_method(CrossMethod.LINK_BY_LINK, estimate, runs)
    assert not other.agrees
    assert "torque constants" in other.sentence


def test_a_check_that_is_impossible_states_its_reason(arm: KnownArm, measure: Measure) -> None:
    joint = arm.robot.joints[0].model_copy(update={"efficiency": 0.9})
    robot = arm.robot.model_copy(update={"joints": (joint, *arm.robot.joints[1:])})
    parts = list(single_periods(measure(periods=2), 10.0).values())
    estimate = fit_smoothed(robot, parts).estimate()
    energies, _, kalman = cross_checks(estimate, runs_of(parts))
    for other in (energies, kalman):
        assert other.agrees is None
        assert other.largest == 0.0
        assert other.trouble.endswith("[RID-MODEL-LOAD-FRICTION]")


@pytest.mark.parametrize("late_s", [0.006, -0.004])
def test_a_delayed_torque_gives_no_false_alarm(late_s: float) -> None:
    """The equations for single joints include the delay.

    The checks by energy and simulation are skipped.
    """
    way = motion(40.0, 3)
    channel = TorqueChannel.of_delays(np.full(3, late_s), np.full(3, 1e-5))
    on_time = written({}, way)
    late = replace(on_time, torque_nm=channel.through(on_time.torque_nm, STEP_S))
    signals = replace(smooth_nonperiodic(late, 10.0), channel=channel)
    estimate = fit_smoothed(with_presliding((), 0.03), [signals]).estimate()
    energies, by_link, kalman = cross_checks(estimate, runs_of([signals]))
    assert by_link.agrees, by_link.sentence
    for other in (energies, kalman):
        assert other.agrees is None
        assert other.trouble.endswith("[RID-CROSS-CHECK-CHANNEL]")


def test_a_diverging_simulation_gives_no_verdict(arm: KnownArm, measure: Measure) -> None:
    estimate, runs = estimate_and_runs(arm, measure)
    weightless = replace(estimate, values=1e-4 * estimate.values)
    kalman = check_method(CrossMethod.KALMAN, weightless, runs)
    assert kalman.agrees is None
    assert kalman.trouble.endswith("[RID-MODEL-MISFIT]")


def test_the_energy_check_follows_presliding_hysteresis() -> None:
    way = motion(60.0, 3)
    directions = {j: iwan(way[0][:, j], 0.03) for j in range(3)}
    signals = recording(directions, way)
    estimate = fit_smoothed(with_presliding((0, 1, 2), 0.03), [signals]).estimate()
    energies = check_method(CrossMethod.ENERGY, estimate, runs_of([signals]))
    assert energies.agrees, energies.sentence
