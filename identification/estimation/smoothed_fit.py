"""`SmoothedFit`: least squares on smoothed recordings in the time domain, block by block.

A joint's equation is left out while the joint is slower than the standstill speed. Neighbouring
rows are not independent; the cluster-robust covariance treats one second of all joints as one
cluster.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from config.arrays import FloatArray, IntArray
from dynamics.model.robot_model import RobotModel
from identification.equations.time_domain import (
    TimeBlock,
    TimeRun,
    rows_by_event,
    time_blocks,
)
from identification.estimation.nonlinear_parameters import fit_nonlinear, step_prior
from identification.estimation.options import Weighting
from identification.estimation.prior import PriorRows
from identification.model.base_parameters import BaseParameters
from identification.model.torque_columns import torque_structure
from identification.regression.intervals import Cluster, Scatter, jackknife
from identification.regression.least_squares import Solution, Triangle, huber_weights, solve

REWEIGHTINGS = 20
SETTLED = 1e-6


@dataclass(frozen=True, eq=False)
class SmoothedFit:
    """The solution for one set of columns.

    Attributes:
        solution: Base parameters and, if derivatives were requested, steps of the nonlinear
            parameters.
        residual_nm: Shape (n,). RMS residual of each joint [N m or N].
        torque_nm: Shape (n,). RMS of each joint's torque on the same rows [N m or N].
        scale_nm: Shape (n,). Scale by which each joint's rows were divided.
        rows_used: Shape (n,). Number of rows used of each joint.
    """

    solution: Solution
    residual_nm: FloatArray
    torque_nm: FloatArray
    scale_nm: FloatArray
    rows_used: FloatArray


@dataclass(frozen=True, eq=False)
class SmoothedProblem:
    """Recordings, and the weighting of their rows.

    Attributes:
        base: The parameters to estimate.
        runs: The recordings.
        standstill_rad_s: Speed above which a joint counts as moving [rad/s or m/s].
        weighting: Weighting of the rows.
        prior: Prior knowledge.
        still: Indices of the joints that no run moves: their rows are not used.
    """

    base: BaseParameters
    runs: tuple[TimeRun, ...]
    standstill_rad_s: float
    weighting: Weighting
    prior: PriorRows
    still: tuple[int, ...] = ()

    @property
    def samples(self) -> int:
        """Number of rows of all recordings."""
        return sum(len(run.signals) for run in self.runs)

    def blocks(
        self, model: RobotModel, standard: FloatArray | None, *, low_passed: bool = False
    ) -> Iterator[TimeBlock]:
        """Yield the equations of the recordings, as `time_blocks` does."""
        blocks = time_blocks(
            model,
            self.base,
            self.runs,
            self.standstill_rad_s,
            standard,
            low_passed=low_passed,
        )
        counts = ~np.isin(np.arange(model.chain.n), self.still)
        for block in blocks:
            yield replace(block, use=block.use & counts)

    def fit(
        self, model: RobotModel, standard: FloatArray | None, scale: FloatArray | None = None
    ) -> SmoothedFit:
        """Solve for the parameters of the columns that `torque_columns` returns for the arguments.

        Each joint's rows are divided by `scale`, shape (n,), if it is given, otherwise as selected
        by `weighting`.

        Raises:
            EstimationError: The motion does not determine the parameters.
        """
        structure = torque_structure(model, self.base, standard is not None)
        triangles = self._triangles(model, standard, structure, None)
        fit = self._solve(model, triangles, standard is not None, scale)
        if self.weighting != "huber":
            return fit
        for _ in range(REWEIGHTINGS):
            triangles = self._triangles(model, standard, structure, fit)
            better = self._solve(model, triangles, standard is not None, fit.scale_nm)
            change = np.abs(better.solution.values - fit.solution.values)
            fit = better
            if np.all(change <= 1e-3 * np.sqrt(np.diagonal(fit.solution.covariance))):
                break
        return fit

    def scatter(self, model: RobotModel, standard: FloatArray | None, fit: SmoothedFit) -> Scatter:
        """Return the covariance of the solution, from leaving out each time interval in turn."""
        structure = torque_structure(model, self.base, standard is not None)
        blocks = self.blocks(model, standard)
        huber = self.weighting == "huber"
        values, scale_nm = fit.solution.values, fit.scale_nm
        clusters = time_clusters(blocks, structure, values, scale_nm, huber=huber)
        return jackknife(fit.solution.information, clusters)

    def _triangles(
        self,
        model: RobotModel,
        standard: FloatArray | None,
        structure: tuple[IntArray, ...],
        previous: SmoothedFit | None,
    ) -> list[Triangle]:
        width = len(self.base) + (0 if standard is None else len(model.nonlinear_names))
        triangles = [Triangle.empty(width, columns) for columns in structure]
        for block in self.blocks(model, standard):
            rows = np.arange(len(block.rhs))
            for j, columns in enumerate(structure):
                matrix, rhs = block.of_joint(j, rows, columns)
                if previous is not None:
                    misfit = rhs - matrix @ previous.solution.values[columns]
                    root = np.sqrt(huber_weights(misfit / previous.scale_nm[j]))
                    matrix, rhs = matrix * root[:, np.newaxis], rhs * root
                triangles[j] = triangles[j].add(matrix, rhs)
        return triangles

    def _solve(
        self,
        model: RobotModel,
        triangles: Sequence[Triangle],
        slopes: bool,
        scale: FloatArray | None = None,
    ) -> SmoothedFit:
        """Weight each joint by one over its residual, found by iteration, or by `scale`."""
        names = (*self.base.names, *(model.nonlinear_names if slopes else ()))
        known = [self.prior.triangle(len(names))]
        if slopes:
            known.append(step_prior(model, len(self.base)))
        rows = np.array([triangle.rows for triangle in triangles], dtype=np.float64)
        if scale is not None:
            solution = solve_weighted(triangles, known, scale, names)
        elif self.weighting == "ls":
            solution = solve_weighted(triangles, known, np.ones(len(triangles)), names)
            residual = residual_rms(triangles, solution.values)
            overall = float(np.sqrt(np.sum(rows * residual**2) / np.sum(rows)))
            scale = np.full(len(triangles), max(overall, 1e-300))
            solution = solve_weighted(triangles, known, scale, names)
        else:
            solution, scale = solve_weighted_by_residuals(triangles, known, names)
        nothing = np.zeros_like(solution.values)
        return SmoothedFit(
            solution,
            residual_rms(triangles, solution.values),
            residual_rms(triangles, nothing),
            scale,
            rows,
        )


def time_clusters(
    blocks: Iterable[TimeBlock],
    structure: Sequence[IntArray],
    values: FloatArray,
    scale_nm: FloatArray,
    *,
    huber: bool = False,
) -> Iterator[Cluster]:
    """Yield each interval of time, all joints together, as a cluster.

    Args:
        blocks: The equations.
        structure: The columns that each joint's torque depends on.
        values: Shape (p,). The solution.
        scale_nm: Shape (n,). Scale by which each joint's rows are divided.
        huber: True to down-weight rows with large residuals.
    """
    for stretch in rows_by_event(blocks):
        gram, score = np.zeros((len(values), len(values))), np.zeros(len(values))
        for block, rows in stretch:
            for j, columns in enumerate(structure):
                matrix, rhs = block.of_joint(j, rows, columns)
                misfit = rhs - matrix @ values[columns]
                weights = np.full(len(rhs), scale_nm[j] ** -2)
                if huber:
                    weights *= huber_weights(misfit)
                solve_weighted = (matrix * weights[:, np.newaxis]).T
                gram[columns[:, np.newaxis], columns] += solve_weighted @ matrix
                score[columns] += solve_weighted @ misfit
        yield Cluster(gram, score)


Fit = Callable[[RobotModel, FloatArray | None, FloatArray | None], SmoothedFit]
"""Function that solves a model's equations, as `SmoothedProblem.fit` does."""


def fit_with_nonlinear(
    model: RobotModel, base: BaseParameters, fit: Fit
) -> tuple[RobotModel, FloatArray | None, SmoothedFit]:
    """Fit a model, including its nonlinear parameters if it has any.

    Args:
        model: The model with its starting values.
        base: The base parameters of its linear part.
        fit: Function that solves its equations.

    Returns:
        `model`. The model with fitted nonlinear parameters.
        `standard`, shape (p,). Point of the equations' linearisation; None if the model is linear.
        `fit`. The solution.

    Raises:
        EstimationError: The motion does not determine the parameters.
    """
    found = fit(model, None, None)
    if not model.nonlinear_names:
        return model, None, found
    return fit_from(model, base, fit, found.solution.values, found.scale_nm)


def fit_from(
    model: RobotModel, base: BaseParameters, fit: Fit, values: FloatArray, scale_nm: FloatArray
) -> tuple[RobotModel, FloatArray, SmoothedFit]:
    """Fit a model with nonlinear parameters, beginning with known base parameters, shape (b,).

    The other arguments and the results are those of `fit_with_nonlinear`; until the last solution,
    each joint's rows are divided by `scale_nm`, shape (n,).
    """
    shaped = fit_nonlinear(
        model, base, values, lambda model, standard: fit(model, standard, scale_nm).solution
    )
    return shaped.model, shaped.standard, fit(shaped.model, shaped.standard, None)


def solve_weighted_by_residuals(
    triangles: Sequence[Triangle], known: Sequence[Triangle], names: tuple[str, ...]
) -> tuple[Solution, FloatArray]:
    """Solve with each joint's rows divided by their RMS residual, found by iteration.

    Args:
        triangles: Triangle of each joint's equations.
        known: Prior knowledge, already weighted.
        names: The parameters.

    Returns:
        `solution`. The estimate.
        `scale_nm`, shape (n,). Scale by which each joint's rows were divided.

    Raises:
        EstimationError: The motion does not determine the parameters.
    """
    scale = np.ones(len(triangles))
    solution = solve_weighted(triangles, known, scale, names)
    for _ in range(REWEIGHTINGS):
        residual = residual_rms(triangles, solution.values)
        better = np.maximum(residual, 1e-9 * residual.max() + 1e-300)
        settled = bool(np.all(np.abs(scale / better - 1.0) < SETTLED))
        scale = better
        solution = solve_weighted(triangles, known, scale, names)
        if settled:
            break
    return solution, scale


def solve_weighted(
    triangles: Sequence[Triangle],
    known: Sequence[Triangle],
    scale: FloatArray,
    names: tuple[str, ...],
) -> Solution:
    """Solve with each joint's rows divided by its `scale`, shape (n,)."""
    return solve([*triangles, *known], [*(1.0 / scale), *(1.0 for _ in known)], names)


def residual_rms(triangles: Sequence[Triangle], values: FloatArray) -> FloatArray:
    """Return the RMS of each joint's torque minus its prediction by `values`, (n,)."""
    error = np.array([triangle.residual_sum(values) for triangle in triangles])
    rows = np.array([triangle.rows for triangle in triangles], dtype=np.float64)
    return np.asarray(np.sqrt(error / np.maximum(rows, 1.0)))
