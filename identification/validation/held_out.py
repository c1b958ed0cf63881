"""Comparison of two fits on held-out seconds, joint by joint."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from config.arrays import FloatArray, IntArray
from config.errors import EstimationError
from identification.equations.time_domain import TimeBlock, rows_by_event
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_signals import FittedSignals
from identification.estimation.smoothed_fit import solve_weighted_by_residuals
from identification.model.torque_columns import torque_structure
from identification.regression.least_squares import Triangle
from identification.regression.nested_choice import DISTINCT_SIGMAS, joints_that_gain

FOLDS: Final = 6
MOST_ROWS: Final = 2
"""A second with more rows per column than this is factorised."""


@dataclass(frozen=True, eq=False)
class Second:
    """Equations of one second of motion: `train` for the fit, `judge` for the error.

    There is one triangle for each joint. `factor` of a triangle with few rows contains these rows:
    one factorisation of many rows costs less than many of few rows.
    """

    train: tuple[Triangle, ...]
    judge: tuple[Triangle, ...]


@dataclass(frozen=True, eq=False)
class LeftOutParts:
    """Equations of recordings, which are solved with one part after the other left out.

    Attributes:
        part: Shape (seconds,). Index of each second's part, from 0.
        train: Equations of each part, one triangle for each joint.
        judge: Equations of each second, one triangle for each joint.
    """

    part: IntArray
    train: tuple[tuple[Triangle, ...], ...]
    judge: tuple[tuple[Triangle, ...], ...]

    @classmethod
    def of(cls, seconds: Iterable[Second], part: IntArray) -> LeftOutParts:
        """Join the seconds of each part."""
        train: list[list[tuple[Triangle, ...]]] = [[] for _ in range(int(part[-1]) + 1)]
        judge = []
        for second, number in zip(seconds, part, strict=True):
            train[number].append(second.train)
            judge.append(second.judge)
        return cls(part, tuple(_join_joints(own) for own in train), tuple(judge))

    def values(self, kept: IntArray | None = None, left_out: int | None = None) -> FloatArray:
        """Return the solution without one part; parameters that are not in `kept` are zero.

        Raises:
            EstimationError: The other parts do not determine the parameters.
        """
        parts = [own for number, own in enumerate(self.train) if number != left_out]
        kept = np.arange(parts[0][0].parameters) if kept is None else kept
        joined = _join_joints([tuple(each.reduced(kept) for each in own) for own in parts])
        names = tuple(map(str, kept))
        values = np.zeros(parts[0][0].parameters)
        values[kept] = solve_weighted_by_residuals(joined, [], names)[0].values
        return values

    def errors(self, kept: IntArray | None = None) -> FloatArray:
        """Return the mean squared error of each second, (seconds, n), by a fit without its part.

        It is NaN for a second without usable samples.

        Raises:
            EstimationError: A part does not determine the parameters in `kept`.
        """
        errors = np.full((len(self.part), len(self.train[0])), np.nan)
        for left_out in range(len(self.train)):
            values = self.values(kept, left_out)
            for number in np.flatnonzero(self.part == left_out):
                for j, triangle in enumerate(self.judge[number]):
                    if triangle.rows:
                        errors[number, j] = triangle.residual_sum(values) / triangle.rows
        return errors


def held_out_errors(plain: FittedSignals, full: FittedSignals, folds: int = FOLDS) -> FloatArray:
    """Return mean squared errors of two fits of the same recordings on held-out seconds.

    The nonlinear parameters are fitted to all data and are the same in every fold. The linear
    parameters are fitted anew in each fold, to all parts but one.

    Args:
        plain, full: The simpler and the richer fit. The errors of both are computed on the samples
            that the richer one uses.
        folds: Number of contiguous parts of the recordings; each is left out once.

    Returns:
        Shape (2, seconds, n). NaN for a second without usable samples.

    Raises:
        EstimationError: The recordings have less than two parts, or the parts without one of them
            do not determine the parameters.
    """
    part = parts_of_seconds(plain, folds)
    both = zip(*_seconds(plain, full), strict=True)
    return np.array([LeftOutParts.of(seconds, part).errors() for seconds in both])


def identified_values(
    richer: Estimate, errors: FloatArray, symbol: str
) -> tuple[float | None, ...]:
    """Return a nonlinear parameter of each joint; None if the data do not determine it.

    The data determine it if the richer model has it and predicts the joint distinctly better, and
    if its value is distinct from zero and not at a bound.

    Args:
        richer: Estimate of the richer model.
        errors: Shape (2, seconds, n). Errors from `held_out_errors`.
        symbol: Prefix of the parameter's name.
    """
    names, worth = richer.model.nonlinear_names, joints_that_gain(*errors)
    values: list[float | None] = []
    for joint, worthy in zip(richer.robot.joint_names, worth, strict=True):
        if not worthy or f"{symbol}_{joint}" not in names:
            values.append(None)
            continue
        at = names.index(f"{symbol}_{joint}")
        value, sigma = float(richer.model.nonlinear_values[at]), richer.nonlinear_sigma[at]
        doubtful = value < DISTINCT_SIGMAS * sigma or names[at] in richer.nonlinear_unseen
        values.append(float(f"{value:.3g}") if not doubtful else None)
    return tuple(values)


def parts_of_seconds(fit: FittedSignals, folds: int = FOLDS) -> IntArray:
    """Return for each second the index of its part, from 0; a part is an interval of one run.

    Raises:
        EstimationError: The recordings have less than two parts.
    """
    seconds = [int(run.event[-1]) + 1 for run in fit.problem.runs]
    each = max(1, folds // len(seconds))
    cut = [piece for own in seconds for piece in np.array_split(np.zeros(own), each) if len(piece)]
    if len(cut) < 2:
        raise EstimationError(
            "the recordings are too short to be split into two parts for a comparison: use"
            " longer recordings",
            code="RID-RECORDING-SHORT",
        )
    return np.repeat(np.arange(len(cut)), [len(piece) for piece in cut])


def _seconds(plain: FittedSignals, full: FittedSignals) -> Iterator[tuple[Second, Second]]:
    """Yield the equations of each second for the simpler and for the richer model."""
    simpler, richer = (
        rows_by_event(fit.problem.blocks(fit.model, fit.standard, low_passed=True))
        for fit in (plain, full)
    )
    structures = [torque_structure(fit.model, fit.base, False) for fit in (plain, full)]
    for stretches in zip(simpler, richer, strict=True):
        own, second = (
            condense_second(stretch, structure, len(fit.base))
            for fit, structure, stretch in zip((plain, full), structures, stretches, strict=True)
        )
        pairs = list(zip(*stretches, strict=True))
        if all(np.array_equal(block.use, other.use) for (block, _), (other, _) in pairs):
            first = own
        else:
            judged = [(replace(block, use=other.use), rows) for (block, rows), (other, _) in pairs]
            first = condense_second(judged, structures[0], len(plain.base))
        yield Second(own, first), Second(second, second)


def condense_second(
    stretch: Sequence[tuple[TimeBlock, IntArray]], structure: Sequence[IntArray], parameters: int
) -> tuple[Triangle, ...]:
    """Return the equations of a time interval for each joint; only many rows are factorised."""
    found = []
    for j, columns in enumerate(structure):
        own = [block.of_joint(j, rows, columns) for block, rows in stretch]
        matrix, rhs = (np.concatenate(each) for each in zip(*own, strict=True))
        if len(rhs) > MOST_ROWS * (len(columns) + 1):
            found.append(Triangle.empty(parameters, columns).add(matrix, rhs))
        else:
            found.append(Triangle(np.column_stack([matrix, rhs]), columns, parameters, len(rhs)))
    return tuple(found)


def _join_joints(parts: Sequence[tuple[Triangle, ...]]) -> tuple[Triangle, ...]:
    """Return the equations of several time intervals as one triangle for each joint."""
    return tuple(_join(of_joint) for of_joint in zip(*parts, strict=True))


def _join(triangles: Sequence[Triangle]) -> Triangle:
    """Return the triangles of one joint as one triangle."""
    factor = np.vstack([triangle.factor for triangle in triangles])
    rows = sum(triangle.rows for triangle in triangles)
    first = triangles[0]
    return Triangle.empty(first.parameters, first.columns).add(factor[:, :-1], factor[:, -1], rows)
