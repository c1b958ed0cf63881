"""Gauss-Newton step of one additional parameter per joint, together with all others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from config.arrays import FloatArray
from identification.equations.time_domain import TimeBlock
from identification.estimation.fitted_signals import FittedSignals
from identification.estimation.nonlinear_parameters import step_prior
from identification.estimation.smoothed_fit import solve_weighted_by_residuals, time_clusters
from identification.model.torque_columns import torque_structure
from identification.regression.intervals import jackknife
from identification.regression.least_squares import Triangle


def additional_parameter_steps(
    fitted: FittedSignals, slope: FloatArray, seconds: int = 1
) -> tuple[FloatArray, FloatArray]:
    """Return the step of each joint's additional parameter, and its standard deviation, (n,) each.

    Args:
        fitted: A fit of thinned recordings, with the additional parameters at their current values.
        slope: Shape (rows, n). Derivative of each joint's torque with respect to its own parameter,
            in all rows of the equations.
        seconds: Number of seconds that count as one cluster: slow effects have correlated errors.

    Raises:
        EstimationError: The motion does not determine the parameters.
    """
    structure = torque_structure(fitted.model, fitted.base, fitted.standard is not None)
    nonlinear = 0 if fitted.standard is None else len(fitted.model.nonlinear_names)
    width, n = len(fitted.base) + nonlinear, fitted.model.chain.n
    own = [np.append(columns, width + j) for j, columns in enumerate(structure)]
    triangles = [Triangle.empty(width + n, columns) for columns in own]
    for block in _blocks(fitted, slope, seconds):
        rows = np.arange(len(block.rhs))
        triangles = [t.add(*block.of_joint(j, rows, own[j])) for j, t in enumerate(triangles)]
    names = tuple(map(str, range(width + n)))
    known = [] if not nonlinear else [step_prior(fitted.model, len(fitted.base), width + n)]
    solution, scale = solve_weighted_by_residuals(triangles, known, names)
    clusters = time_clusters(_blocks(fitted, slope, seconds), own, solution.values, scale)
    covariance = jackknife(solution.information, clusters).quoted
    return solution.values[width:], np.sqrt(np.diagonal(covariance)[width:])


def _blocks(fitted: FittedSignals, slope: FloatArray, seconds: int) -> Iterator[TimeBlock]:
    """Yield the equations with one more column per joint, for the additional parameters."""
    first, n = 0, slope.shape[1]
    for block in fitted.problem.blocks(fitted.model, fitted.standard):
        extra = np.zeros((len(block.rhs), n, n))
        extra[:, range(n), range(n)] = slope[first : first + len(block.rhs)]
        columns = np.concatenate([block.columns, extra], axis=2)
        yield replace(block, columns=columns, event=block.event // seconds)
        first += len(block.rhs)
