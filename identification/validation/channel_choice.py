"""What a recording's torque went through, chosen by the data: its bandwidth and its delays.

A torque that was low-passed before it was recorded jumps slower than friction does, and every joint
that turns round then shows an error that no model of the robot explains. The bandwidth is the one
with which low-passed columns fit best; it is taken where the logarithm of the error on seconds left
out falls by more than two standard errors, all joints together. Delays are parameters beside all
others: torque late by d is tau(t) - d tau'(t) to first order (Gauss-Newton). They are found in rows
away from reversals: friction that no model has does there what a delay does. A joint's is taken
where it is two standard deviations from zero, and where the logarithm of the error on seconds left
out falls by more than two standard errors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from identification.equations.segments import thinned
from identification.equations.torque_channel import TorqueChannel
from identification.estimation.fitted_signals import FittedSignals, fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.validation.friction_trials import with_friction
from identification.validation.held_out import FOLDS, distinctly_better, held_out_errors
from identification.validation.steps_beside import steps_beside

STEP: Final = 0.75
LOWEST_SHARE: Final = 0.08
"""Of the cut-off: how far down bandwidths are tried, each `STEP` of the one before."""
DISTINCT_SIGMAS: Final = 2.0
LONGEST_DELAY_S: Final = 0.1
ROUNDS: Final = 2
_FLEXIBLE: Final[tuple[FrictionTerm, ...]] = (
    "coulomb", "viscous", "offset", "cube_root", "cubic",
)  # fmt: skip


def choose_bandwidth(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: EstimationOptions | None = None,
    *,
    folds: int = FOLDS,
) -> float | None:
    """Return where the torque was low-passed before it was recorded [Hz]; None for nowhere.

    Parameters
    ----------
    robot : RobotDescription
        The robot; its friction terms do not count.
    signals : sequence of SmoothedSignals
        The recordings of the training runs.
    options : EstimationOptions, optional
        The other terms of the model, and from which speed on a joint moves.
    folds : int
        Parts that the recordings are cut into.

    Raises
    ------
    EstimationError
        The recordings are too short, or do not show the model.
    """
    options = options or EstimationOptions()
    robot = with_friction(robot, [_FLEXIBLE] * len(robot.joints))
    parts = [thinned(run) for run in signals]
    cutoff_hz = min(part.cutoff_hz for part in parts)

    def fit(bandwidth_hz: float) -> FittedSignals:
        narrow = [replace(part, torque_bandwidth_hz=bandwidth_hz) for part in parts]
        return fit_smoothed(robot, narrow, options)

    def misfit(fitted: FittedSignals) -> float:
        return float(np.sum(fitted.fit.rows_used * np.log(fitted.fit.residual_nm)))

    plain = fit(cutoff_hz)
    tried = {cutoff_hz: (misfit(plain), plain)}
    steps = math.floor(math.log(LOWEST_SHARE) / math.log(STEP))
    for bandwidth_hz in (cutoff_hz * STEP**k for k in range(1, steps + 1)):
        fitted = fit(bandwidth_hz)
        tried[bandwidth_hz] = (misfit(fitted), fitted)
        if misfit(fitted) > min(value for value, _ in tried.values()) + fitted.fit.rows_used.sum():
            break  # e times the residual of the best one
    best = min(tried, key=lambda hz: tried[hz][0])
    for width in (0.5, 0.25):
        for bandwidth_hz in (best * STEP**width, best / STEP**width):
            if bandwidth_hz < cutoff_hz:
                fitted = fit(bandwidth_hz)
                tried[bandwidth_hz] = (misfit(fitted), fitted)
        best = min(tried, key=lambda hz: tried[hz][0])
    if best >= STEP * cutoff_hz:
        return None
    errors = held_out_errors(plain, tried[best][1], folds)
    gain = np.nansum(np.log(errors[0] / errors[1]), axis=1)
    enough = gain.mean() > DISTINCT_SIGMAS * np.std(gain, ddof=1) / math.sqrt(len(gain))
    return float(f"{best:.3g}") if enough else None


def choose_delays(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: EstimationOptions | None = None,
    *,
    folds: int = FOLDS,
) -> TorqueChannel:
    """Return by how much each joint's torque is late, zero where the data do not show it.

    Parameters
    ----------
    robot : RobotDescription
        The robot with all its terms: what friction does at a reversal resembles a delay.
    signals : sequence of SmoothedSignals
        The recordings of the training runs; their `torque_bandwidth_hz` is kept.
    options : EstimationOptions, optional
        The other terms of the model.
    folds : int
        Parts that the recordings are cut into.

    Raises
    ------
    EstimationError
        The recordings are too short, or do not show the model.
    """
    options = options or EstimationOptions()
    parts = [thinned(run) for run in signals]
    fitted = fit_smoothed(robot, parts, options)
    plain = replace(fitted, problem=replace(fitted.problem, sliding_alone=True))
    try:
        return _delays_beside(plain, parts, folds)
    except EstimationError:  # too little is left away from the reversals
        nothing = np.zeros(len(robot.joints))
        return TorqueChannel(nothing, nothing, parts[0].torque_bandwidth_hz)


def _delays_beside(
    plain: FittedSignals, parts: Sequence[SmoothedSignals], folds: int
) -> TorqueChannel:
    """Return the delays of the torques of a fit's recordings, beside all that was fitted."""
    n, bandwidth_hz = len(plain.robot.joints), parts[0].torque_bandwidth_hz
    fitted, delay_s, sigma_s = plain, np.zeros(n), np.zeros(n)
    for _ in range(ROUNDS):
        step_s, sigma_s = steps_beside(fitted, _slope(fitted))
        delay_s = np.clip(delay_s + step_s, -LONGEST_DELAY_S, LONGEST_DELAY_S)
        channel = TorqueChannel(delay_s, sigma_s, bandwidth_hz)
        runs = tuple(
            replace(run, signals=channel.undelayed(part))
            for run, part in zip(plain.problem.runs, parts, strict=True)
        )
        fitted = replace(plain, problem=replace(plain.problem, runs=runs))
    shown = np.abs(delay_s) > DISTINCT_SIGMAS * sigma_s
    shown &= np.abs(delay_s) < LONGEST_DELAY_S
    shown &= distinctly_better(held_out_errors(plain, fitted, folds))
    return TorqueChannel(delay_s * shown, sigma_s * shown, bandwidth_hz)


def _slope(fitted: FittedSignals) -> FloatArray:
    """Return how each joint's torque changes with its delay: minus its own rate [N m/s]."""
    rates = []
    for run in fitted.problem.runs:
        edges = np.flatnonzero(np.diff(run.signals.segment)) + 1
        pieces = np.split(run.signals.torque_nm, edges)
        rates += [np.gradient(piece, run.signals.sample_period_s, axis=0) for piece in pieces]
    return -np.concatenate(rates)
