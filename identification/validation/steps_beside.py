"""One more parameter a joint beside all others: its Gauss-Newton step, and its deviation."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from config.arrays import FloatArray, IntArray
from identification.equations.time_domain import TimeBlock
from identification.estimation.fitted_signals import FittedSignals
from identification.estimation.nonlinear_parameters import step_prior
from identification.estimation.smoothed_fit import weighted_by_residuals
from identification.model.torque_columns import torque_structure
from identification.regression.intervals import Cluster, jackknife
from identification.regression.least_squares import Triangle


def steps_beside(
    fitted: FittedSignals, slope: FloatArray, seconds: int = 1
) -> tuple[FloatArray, FloatArray]:
    """Return how far each joint's parameter has to go, and its standard deviation, (n,) each.

    Args:
        fitted: A fit of thinned recordings, the parameters at their present values.
        slope: Shape (rows, n). How each joint's torque changes with its own parameter, in all rows
            of the equations.
        seconds: How many seconds count as one event: what is slow is the same error for long.

    Raises:
        EstimationError: The motion does not show the parameters.
    """
    structure = torque_structure(fitted.model, fitted.base, fitted.standard is not None)
    nonlinear = 0 if fitted.standard is None else len(fitted.model.nonlinear_names)
    width, n = len(fitted.base) + nonlinear, fitted.model.chain.n
    own = [np.append(columns, width + j) for j, columns in enumerate(structure)]
    triangles = [Triangle.empty(width + n, columns) for columns in own]
    for block, extra in _blocks(fitted, slope):
        for j, columns in enumerate(structure):
            use = np.flatnonzero(block.use[:, j])
            triangles[j] = triangles[j].add(
                _matrix(block, extra, use, j, columns), block.rhs[use, j]
            )
    names = tuple(map(str, range(width + n)))
    known = [] if not nonlinear else [step_prior(fitted.model, len(fitted.base), width + n)]
    solution, scale = weighted_by_residuals(triangles, known, names)

    def clusters() -> Iterator[Cluster]:
        gram, score, current = np.zeros((width + n,) * 2), np.zeros(width + n), 0
        for block, extra in _blocks(fitted, slope):
            event = block.event // seconds
            for rows in np.split(np.arange(len(event)), np.flatnonzero(np.diff(event)) + 1):
                if event[rows[0]] != current:
                    yield Cluster(gram, score)
                    gram, score = np.zeros_like(gram), np.zeros_like(score)
                    current = int(event[rows[0]])
                for j, columns in enumerate(structure):
                    use = rows[block.use[rows, j]]
                    matrix = _matrix(block, extra, use, j, columns)
                    misfit = block.rhs[use, j] - matrix @ solution.values[own[j]]
                    gram[own[j][:, np.newaxis], own[j]] += matrix.T @ matrix / scale[j] ** 2
                    score[own[j]] += matrix.T @ misfit / scale[j] ** 2
        yield Cluster(gram, score)

    covariance = jackknife(solution.information, clusters()).quoted
    return solution.values[width:], np.sqrt(np.diagonal(covariance)[width:])


def _blocks(fitted: FittedSignals, slope: FloatArray) -> Iterator[tuple[TimeBlock, FloatArray]]:
    problem, first = fitted.problem, 0
    for block in problem.blocks(fitted.model, fitted.standard):
        yield block, slope[first : first + len(block.rhs)]
        first += len(block.rhs)


def _matrix(
    block: TimeBlock, extra: FloatArray, use: IntArray, joint: int, columns: IntArray
) -> FloatArray:
    own = extra[use, joint][:, np.newaxis]
    return np.hstack([block.columns[use[:, np.newaxis], joint, columns], own])
