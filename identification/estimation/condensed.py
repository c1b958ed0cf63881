"""`CondensedRecordings`: recordings as triangular factors that serve every model of a robot.

Candidates of friction terms, fitted with and without each part of the recordings, are combinations
of the same columns (`CandidateColumns`). Their rows are gone through once: each stretch of time
leaves one triangular factor a joint, and every fit and every prediction error is computed on
factors. Which way a gear is loaded is taken from the candidate with the most linear terms.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray, IntArray
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel
from dynamics.terms.conditions import Conditions
from identification.equations.parallel_filter import ParallelFilter
from identification.equations.time_domain import EVENT_S
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.nonlinear_parameters import step_prior
from identification.estimation.options import EstimationOptions
from identification.estimation.smoothed_fit import (
    SmoothedFit,
    fit_with_nonlinear,
    residual_rms,
    weighted,
    weighted_by_residuals,
)
from identification.model.base_parameters import BaseParameters
from identification.model.candidate_columns import CandidateColumns
from identification.model.model_columns import ModelColumns
from identification.model.options import ModelOptions
from identification.regression.intervals import Cluster, jackknife
from identification.regression.least_squares import Triangle

MOST_STRETCHES = 300


@dataclass(frozen=True, eq=False)
class CondensedFit:
    """One model's fit to some parts of the recordings.

    Attributes
    ----------
    model : RobotModel
        The model, with fitted nonlinear parameters.
    base : BaseParameters
        What of it can be identified.
    standard : ndarray, shape (p,), or None
        Where the equations are linearised; None where the model is linear.
    fit : SmoothedFit
        The solution.
    """

    model: RobotModel
    base: BaseParameters
    standard: FloatArray | None
    fit: SmoothedFit

    @property
    def values(self) -> FloatArray:
        """The base parameters, shape (b,)."""
        return self.fit.solution.values[: len(self.base)]

    @property
    def parameters(self) -> int:
        """Linear and nonlinear parameters."""
        return len(self.base) + len(self.model.nonlinear_names)


@dataclass(frozen=True, eq=False)
class CondensedRecordings:
    """The factors of all stretches of time, and of all parts but one.

    Attributes
    ----------
    columns : CandidateColumns
        What stands in them.
    options : ModelOptions
        Terms of the models besides friction.
    factors : tuple of ndarray, one a joint, shape (stretches, c + 1, c + 1)
        R of [columns, torque] of each stretch; zero rows where it is shorter.
    rows : ndarray, shape (stretches, n)
        Rows behind each.
    part : ndarray of int64, shape (stretches,)
        The part of the recordings that a stretch belongs to.
    whole : tuple of Triangle, one a joint
        Everything.
    without : tuple of tuple of Triangle
        Everything but one part.
    """

    columns: CandidateColumns
    options: ModelOptions
    factors: tuple[FloatArray, ...]
    rows: FloatArray
    part: IntArray
    whole: tuple[Triangle, ...]
    without: tuple[tuple[Triangle, ...], ...]

    @classmethod
    def of(
        cls,
        rich: RobotDescription,
        simple: RobotDescription,
        parts: Sequence[SmoothedSignals],
        options: EstimationOptions,
    ) -> CondensedRecordings:
        """Condense recordings.

        Parameters
        ----------
        rich : RobotDescription
            The robot with all terms of all candidates on every joint.
        simple : RobotDescription
            A candidate whose model is linear; says which way the gears are loaded.
        parts : sequence of SmoothedSignals
            Contiguous parts of recordings.
        options : EstimationOptions
            The other terms of the model, and the standstill speed.

        Raises
        ------
        EstimationError
            The recordings are not the robot's, or do not show the linear candidate's parameters.
        """
        wide = [replace(part, torque_bandwidth_hz=None) for part in parts]
        loaded = fit_smoothed(simple, wide, options)
        load = (loaded.model, loaded.standard_values)
        columns = CandidateColumns.of(rich, options.model)
        widths = [columns.width(j) for j in range(len(rich.joints))]
        stretches: list[list[Triangle]] = []
        belongs: list[int] = []
        total_s = sum(len(part) * part.sample_period_s for part in parts)
        length_s = max(EVENT_S, total_s / MOST_STRETCHES)
        for number, part in enumerate(parts):
            shared = ParallelFilter(part)
            warmth = Conditions(temperature_k=part.temperature_k)
            conditions = shared.conditions(columns.rich, warmth)
            usable, _ = shared.usable(columns.rich, conditions, options.standstill_rad_s)
            for rows in _stretches(part, length_s):
                matrices = _rows(columns, shared, conditions, rows, load)
                use, torque = usable[rows], shared.torque(np.arange(rows.start, rows.stop))
                stretches.append(
                    [
                        Triangle.empty(width).add(matrix[use[:, j]], torque[use[:, j], j])
                        for j, (matrix, width) in enumerate(zip(matrices, widths, strict=True))
                    ]
                )
                belongs.append(number)
        part_of = np.array(belongs)
        own = [
            _joined([s for s, k in zip(stretches, belongs, strict=True) if k == number])
            for number in range(len(parts))
        ]
        return cls(
            columns=columns,
            options=options.model,
            factors=tuple(
                np.stack([_square(stretch[j]) for stretch in stretches]) for j in range(len(widths))
            ),
            rows=np.array([[each.rows for each in stretch] for stretch in stretches], np.float64),
            part=part_of,
            whole=_joined(own),
            without=tuple(
                _joined([each for k, each in enumerate(own) if k != number])
                for number in range(len(own))
            ),
        )

    def problem(self, robot: RobotDescription) -> CondensedProblem:
        """Return the equations of a robot with some of the candidates' terms."""
        model = self.options.build(robot)
        base = self.columns.base_parameters(model)
        return CondensedProblem(self, model, ModelColumns(self.columns, base))


@dataclass(frozen=True, eq=False)
class CondensedProblem:
    """The equations of one model on condensed recordings."""

    data: CondensedRecordings
    model: RobotModel
    columns: ModelColumns

    @property
    def base(self) -> BaseParameters:
        """What can be identified of the model."""
        return self.columns.base

    def fit(self, start: RobotModel | None = None, left_out: int | None = None) -> CondensedFit:
        """Fit the model to all parts of the recordings but one, or to all of them.

        Parameters
        ----------
        start : RobotModel, optional
            Where nonlinear parameters start.
        left_out : int, optional
            The part that is left out.

        Raises
        ------
        EstimationError
            The motion does not show the parameters.
        """
        data = self.data
        triangles = data.whole if left_out is None else data.without[left_out]

        def solve(
            model: RobotModel, standard: FloatArray | None, scale: FloatArray | None = None
        ) -> SmoothedFit:
            return self._solve(triangles, model, standard, scale)

        model, standard, fit = fit_with_nonlinear(start or self.model, self.base, solve)
        return CondensedFit(model, self.base, standard, fit)

    def mean_squares(self, fit: CondensedFit, part: int) -> FloatArray:
        """Return the mean squared error of a fit on the stretches of a part.

        Returns
        -------
        ndarray, shape (stretches, n)
            NaN where a joint does not move.
        """
        data = self.data
        own = np.flatnonzero(data.part == part)
        rows = data.rows[own]
        squares = np.empty(rows.shape)
        for j, factors in enumerate(data.factors):
            values = self._combination(j, fit)[:, : len(self.base)] @ fit.values
            error = factors[own] @ np.append(values, -1.0)
            squares[:, j] = np.sum(error**2, axis=1)
        return np.where(rows > 0.0, squares / np.maximum(rows, 1.0), np.nan)

    def covariance(self, fit: CondensedFit) -> FloatArray:
        """Return the cluster-robust covariance of linear and nonlinear parameters."""
        return jackknife(fit.fit.solution.information, self._clusters(fit)).quoted

    def _clusters(self, fit: CondensedFit) -> Iterator[Cluster]:
        made = [self._combination(j, fit) for j in range(len(self.data.factors))]
        values = fit.fit.solution.values
        for stretch in range(len(self.data.part)):
            rows = [
                np.column_stack([factors[stretch, :, :-1] @ matrix, factors[stretch, :, -1]])
                / scale
                for factors, matrix, scale in zip(
                    self.data.factors, made, fit.fit.scale_nm, strict=True
                )
            ]
            matrix = np.vstack(rows)
            yield Cluster.of(matrix[:, :-1], matrix[:, -1] - matrix[:, :-1] @ values)

    def _combination(self, joint: int, fit: CondensedFit) -> FloatArray:
        return self.columns.combination(joint, fit.model, fit.standard)

    def _solve(
        self,
        triangles: Sequence[Triangle],
        model: RobotModel,
        standard: FloatArray | None,
        scale: FloatArray | None,
    ) -> SmoothedFit:
        """Solve for the columns of `torque_columns`, as `SmoothedProblem` does."""
        names = (*self.base.names, *(() if standard is None else model.nonlinear_names))
        own = []
        for j, triangle in enumerate(triangles):
            matrix = self.columns.combination(j, model, standard)
            used = np.flatnonzero(matrix.any(axis=0))
            columns = triangle.factor[:, :-1] @ matrix[:, used]
            empty = Triangle.empty(len(names), used)
            own.append(empty.add(columns, triangle.factor[:, -1], triangle.rows))
        known = [] if standard is None else [step_prior(model, len(self.base))]
        if scale is None:
            solution, scale = weighted_by_residuals(own, known, names)
        else:
            solution = weighted(own, known, scale, names)
        rows = np.array([triangle.rows for triangle in own], dtype=np.float64)
        residual_nm = residual_rms(own, solution.values)
        torque_nm = residual_rms(own, np.zeros_like(solution.values))
        return SmoothedFit(solution, residual_nm, torque_nm, scale, rows)


def _stretches(part: SmoothedSignals, length_s: float) -> Iterator[slice]:
    """Yield the rows of stretches of a part, which do not reach over gaps between its segments."""
    stretch = np.floor((part.time_s - part.time_s[0]) / length_s)
    edges = np.flatnonzero((np.diff(stretch) != 0.0) | (np.diff(part.segment) != 0)) + 1
    for first, end in pairwise([0, *edges.tolist(), len(part)]):
        yield slice(first, end)


def _rows(
    columns: CandidateColumns,
    shared: ParallelFilter,
    conditions: Conditions,
    rows: slice,
    load: tuple[RobotModel, FloatArray],
) -> list[FloatArray]:
    """Return every joint's columns of some rows, filtered as their torque is, each (rows, any)."""
    signals = shared.signals
    if signals.unfiltered is None and signals.torque_bandwidth_hz is None:
        return columns.rows(shared.motion(rows), conditions.part(rows), load)
    wide, places = shared.window(np.arange(rows.start, rows.stop))
    own = columns.rows(shared.motion(wide), conditions.part(wide), load)
    held = (shared.held(matrix, j, wide) for j, matrix in enumerate(own))
    return [shared.columns(matrix, places) for matrix in held]


def _joined(parts: Sequence[Sequence[Triangle]]) -> tuple[Triangle, ...]:
    """Return the triangles of some parts together, one a joint."""
    joined = []
    for of_joint in zip(*parts, strict=True):
        factor = np.vstack([each.factor for each in of_joint])
        rows = sum(each.rows for each in of_joint)
        joined.append(
            Triangle.empty(of_joint[0].parameters).add(factor[:, :-1], factor[:, -1], rows)
        )
    return tuple(joined)


def _square(triangle: Triangle) -> FloatArray:
    """Return a triangle's factor with rows of zeros below."""
    square = np.zeros((triangle.parameters + 1,) * 2)
    square[: len(triangle.factor)] = triangle.factor
    return square
