"""Choice of the delay of each joint's torque in periodic recordings, from the data.

On the bins of a mean period, a delay d is exactly a factor exp(-j omega d). It is estimated as one
more parameter per joint, together with all others (Gauss-Newton). Near reversals, friction
resembles a delay most and is known least; therefore the torque is free there. Away from reversals,
frequency and pose distinguish the two: viscous friction does not shift the phase of inertia and
gravity torques.

A joint's delay is accepted under three conditions:
- It is two standard deviations from zero.
- The logarithm of the error on left-out bins falls by more than two standard errors.
- It is below a quarter of the shortest period in the band. A longer delay shifts the highest bins
  by more than a right angle. Gauss-Newton steps, which are linear in the delay, then do not
  converge. A delay at this limit is only a bound, and its standard deviation is set to the delay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from acquisition.processing.periods import PeriodAverage
from acquisition.processing.torque_channel import TorqueChannel
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.equations.base_wrench import repeat_for_real_and_imaginary
from identification.equations.bins import BinEquations, with_free_reversals
from identification.equations.whitened import WhitenedEquations, bin_clusters, whiten
from identification.estimation.fitted_periods import FittedPeriods, fit_periodic
from identification.estimation.nonlinear_parameters import step_prior
from identification.estimation.options import EstimationOptions
from identification.regression.intervals import changes_without_clusters, jackknife
from identification.regression.least_squares import Solution, Triangle, solve
from identification.regression.nested_choice import joints_that_gain

DISTINCT_SIGMAS: Final = 2.0
MOST_STEPS: Final = 10
SETTLED_SIGMAS: Final = 0.01
LONGEST_SHARE: Final = 0.25
"""Longest accepted delay, relative to the shortest period in the band."""
NOTHING: Final = 1e-12
"""Smallest squared error that is used, relative to the noise's variance."""

Outputs = tuple[tuple[WhitenedEquations, ...], ...]
"""Whitened equations: one tuple per run, one item per joint."""


def choose_period_delays(
    robot: RobotDescription,
    averages: Sequence[PeriodAverage],
    options: EstimationOptions | None = None,
) -> TorqueChannel:
    """Return the delay of each joint's torque, zero if the data do not show one.

    The standard deviation of a delay at the end of the search range is set to the delay.

    Args:
        robot: The robot with all its terms; presliding determines how far from a reversal friction
            is known.
        averages: The mean periods of the training runs.
        options: The other terms of the model.

    Raises:
        EstimationError: The joints are not those of the robot, or the motion does not determine the
            parameters.
    """
    options = options or EstimationOptions()
    fitted = fit_periodic(robot, averages, options)
    equations = tuple(
        with_free_reversals(each, fitted.model, average, options.standstill_rad_s)
        for each, average in zip(fitted.equations, averages, strict=True)
    )
    longest_s = LONGEST_SHARE * min(each.period_s / each.harmonics for each in equations)
    delay_s, sigma_s = _estimate_delays(fitted, equations, longest_s)
    errors = [
        _left_out_errors(fitted, equations, each) for each in (np.zeros_like(delay_s), delay_s)
    ]
    shown = np.abs(delay_s) > DISTINCT_SIGMAS * sigma_s
    sigma_s = np.where(np.abs(delay_s) < longest_s, sigma_s, np.abs(delay_s))
    shown &= joints_that_gain(errors[0], errors[1], sigmas=DISTINCT_SIGMAS, least=0.0)
    return TorqueChannel.of_delays(np.where(shown, delay_s, 0.0), np.where(shown, sigma_s, 0.0))


def _estimate_delays(
    fitted: FittedPeriods, equations: tuple[BinEquations, ...], longest_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return the joints' delays and their standard deviations, (n,) each."""
    n, b = len(fitted.robot.joints), len(fitted.base)
    values = fitted.fit.solution.values[fitted.fit.of_base]

    def solve_with_delays(delay_s: FloatArray, values: FloatArray) -> tuple[Outputs, Solution]:
        """Solve for delay steps from `delay_s` and all other parameters, linearised at `values`."""
        widened = []
        for each in equations:
            columns = each.delay_columns(each.matrix[:, :, :b] @ values)
            matrix = np.concatenate([each.matrix, columns], axis=2)
            widened.append(replace(each.compensate_delay(delay_s), matrix=matrix))
        white = _whiten_all(fitted, widened)
        return white, _solve(fitted, white, longest_s)

    delay_s = np.zeros(n)
    white, solution = solve_with_delays(delay_s, values)
    for _ in range(MOST_STEPS):
        step_s = solution.values[-n:]
        delay_s = np.clip(delay_s + step_s, -longest_s, longest_s)
        if np.all(step_s**2 <= SETTLED_SIGMAS**2 * np.diagonal(solution.covariance)[-n:]):
            break
        white, solution = solve_with_delays(delay_s, solution.values[:b])
    scatter = jackknife(solution.information, bin_clusters(white, solution.values))
    return delay_s, np.sqrt(np.diagonal(scatter.quoted)[-n:])


def _left_out_errors(
    fitted: FittedPeriods, equations: tuple[BinEquations, ...], delay_s: FloatArray
) -> FloatArray:
    """Return each bin's mean squared error in a prediction from all other bins, (bins, n).

    Errors are in standard deviations of the noise. The nonlinear parameters come from all bins.
    """
    b = len(fitted.base)
    linear = [
        replace(each.compensate_delay(delay_s), matrix=each.matrix[:, :, :b]) for each in equations
    ]
    white = _whiten_all(fitted, linear)
    solution = _solve(fitted, white)
    moved = changes_without_clusters(solution.information, bin_clusters(white, solution.values))
    errors = []
    for parts in white:
        bins = repeat_for_real_and_imaginary(
            np.arange(len(parts[0].rhs) // 2 + 1, dtype=np.float64)
        )
        for number, change in zip(range(int(bins[-1]) + 1), moved, strict=False):
            rows = bins == number
            misses = [
                part.residual(solution.values)[rows] + part.matrix[rows] @ change for part in parts
            ]
            errors.append([max(float(np.mean(miss**2)), NOTHING) for miss in misses])
    return np.array(errors)


def _whiten_all(fitted: FittedPeriods, equations: Sequence[BinEquations]) -> Outputs:
    problem = fitted.problem
    return tuple(
        whiten(each, inertia, uniform=problem.weighting == "ls")
        for each, inertia in zip(equations, problem.inertia, strict=True)
    )


def _solve(fitted: FittedPeriods, white: Outputs, longest_s: float = 0.0) -> Solution:
    """Solve the equations; limit steps that the data do not determine to the parameters' ranges.

    If `longest_s` is not zero, the last n columns are those of delays.
    """
    width, b, n = white[0][0].matrix.shape[1], len(fitted.base), len(fitted.robot.joints)
    triangles = [
        Triangle.empty(width).add(part.matrix, part.rhs, part.rows)
        for parts in white
        for part in parts
    ]
    if longest_s:
        factor = np.column_stack([np.eye(n) / longest_s, np.zeros(n)])
        triangles.append(Triangle(factor, np.arange(width - n, width), width, n))
        if fitted.fit.nonlinear:
            triangles.append(step_prior(fitted.model, b, width))
    return solve(triangles, [1.0] * len(triangles), tuple(map(str, range(width))))
