"""Comparison of two fits on held-out seconds, joint by joint."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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


@dataclass(frozen=True, eq=False)
class _Second:
    """Equations of one second of motion: `train` for the fit, `judge` for the error."""

    train: tuple[Triangle, ...]
    judge: tuple[Triangle, ...]


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
        EstimationError: The recordings have less than two parts.
    """
    part = _parts([int(run.event[-1]) + 1 for run in plain.problem.runs], folds)
    errors = np.full((2, len(part), plain.model.chain.n), np.nan)
    for own, seconds in zip(errors, zip(*_seconds(plain, full), strict=True), strict=True):
        for left_out in range(int(part[-1]) + 1):
            rest = [s.train for s, p in zip(seconds, part, strict=True) if p != left_out]
            joined = [_join(of_joint) for of_joint in zip(*rest, strict=True)]
            names = tuple(map(str, range(joined[0].parameters)))
            values = solve_weighted_by_residuals(joined, [], names)[0].values
            for number in np.flatnonzero(part == left_out):
                for j, triangle in enumerate(seconds[number].judge):
                    if triangle.rows:
                        own[number, j] = triangle.residual_sum(values) / triangle.rows
    return errors


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


def _parts(seconds: Sequence[int], folds: int) -> IntArray:
    """Return for each second the index of its part, from 0; a part is an interval of one run."""
    each = max(1, folds // len(seconds))
    cut = [piece for own in seconds for piece in np.array_split(np.zeros(own), each) if len(piece)]
    if len(cut) < 2:
        raise EstimationError(
            "the recordings are too short to be split into two parts for a comparison: use"
            " longer recordings",
            code="RID-RECORDING-SHORT",
        )
    return np.repeat(np.arange(len(cut)), [len(piece) for piece in cut])


def _seconds(plain: FittedSignals, full: FittedSignals) -> Iterator[tuple[_Second, _Second]]:
    """Yield the equations of each second for the simpler and for the richer model."""
    simpler, richer = (
        rows_by_event(fit.problem.blocks(fit.model, fit.standard, low_passed=True))
        for fit in (plain, full)
    )
    for stretches in zip(simpler, richer, strict=True):
        judged = [
            [(replace(block, use=other.use), rows) for (block, rows), (other, _) in own]
            for own in (zip(stretch, stretches[1], strict=True) for stretch in stretches)
        ]
        first, second = (
            _triangles(fit, own) for fit, own in zip((plain, full), judged, strict=True)
        )
        yield _Second(_triangles(plain, stretches[0]), first), _Second(second, second)


def _triangles(
    fit: FittedSignals, stretch: Sequence[tuple[TimeBlock, IntArray]]
) -> tuple[Triangle, ...]:
    """Return the equations of a time interval, condensed to one triangle per joint."""
    structure = torque_structure(fit.model, fit.base, False)
    triangles = [Triangle.empty(len(fit.base), columns) for columns in structure]
    for block, rows in stretch:
        triangles = [
            triangle.add(*block.of_joint(j, rows, columns))
            for j, (triangle, columns) in enumerate(zip(triangles, structure, strict=True))
        ]
    return tuple(triangles)


def _join(triangles: Sequence[Triangle]) -> Triangle:
    """Return the triangles of one joint as one triangle."""
    factor = np.vstack([triangle.factor for triangle in triangles])
    rows = sum(triangle.rows for triangle in triangles)
    first = triangles[0]
    return Triangle.empty(first.parameters, first.columns).add(factor[:, :-1], factor[:, -1], rows)
