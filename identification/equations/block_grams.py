"""`Grams`: Gram matrices of every candidate column, block by block.

The Gram matrices are computed once. A model with some of the friction terms needs only a subset of
their entries: for its fit, and for its error on a block that was left out of the fit. The equations
of all joints contain the same parameters of the links.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from acquisition.processing.torque_channel import TorqueChannel
from config.arrays import FloatArray, IntArray
from config.robot.friction_terms import FrictionTerm
from identification.equations.candidate_equations import CandidateEquations, Reach, reaches_of
from identification.equations.friction_columns import ALL_COLUMNS, Column
from identification.regression.nested_choice import deviations

Terms = tuple[Column, ...]

PLAIN: Final[Terms] = ("coulomb", "viscous")
MOST_INFLATION: Final = 1e12
"""Largest variance inflation factor of a column that counts as identified."""
RANK: Final = 1e-7


def term_of_column(column: Column) -> FrictionTerm:
    """Return the friction term of a column."""
    if isinstance(column, str):
        return column
    return "shear_thinning" if column[0] == "shear_thinning" else "stribeck"


def columns_of_terms(terms: Sequence[Column]) -> Terms:
    """Return the columns of friction terms; each Stribeck speed adds a derivative (`slope`)."""
    return (*terms, *(("slope", speed) for speed in speeds_of(terms, "stribeck")))


def speeds_of(terms: Sequence[Column], name: FrictionTerm) -> tuple[float, ...]:
    """Return the speeds of the terms of this name [rad/s or m/s]."""
    return tuple(term[1] for term in terms if isinstance(term, tuple) and term[0] == name)


@dataclass(frozen=True, eq=False)
class Fit:
    """Solution for one choice of friction terms.

    Attributes:
        places: Index of each joint's column in `values`.
        values, sigma: Shape (c,). Parameters and standard deviations.
        errors: Shape (blocks, n). Mean squared error of each block when it is left out of the fit;
            NaN for a block without rows.
    """

    places: dict[tuple[int, Column], int]
    values: FloatArray
    sigma: FloatArray
    errors: FloatArray

    def sigmas_from_zero(self, joint: int, column: Column) -> float:
        """Return the coefficient of a joint's column, divided by its standard deviation."""
        at = self.places[joint, column]
        return float(self.values[at] / max(self.sigma[at], 1e-300))

    def value(self, joint: int, column: Column) -> float:
        """Return the coefficient of a joint's column."""
        return float(self.values[self.places[joint, column]])


@dataclass(frozen=True, eq=False)
class Grams:
    """Gram matrices of the joints' equations, block by block.

    Attributes:
        gram: Shape (n, blocks, w, w). Gram matrices of [columns without friction, `ALL_COLUMNS`,
            torque] of each joint, divided by the joint's scale.
        rows: Shape (blocks, n). Number of rows of each block and joint.
        rigid: Shape (p,). The columns without friction that the data identify.
        scale_nm: Shape (n,). Scale by which the rows of each joint were divided.
    """

    gram: FloatArray
    rows: FloatArray
    rigid: IntArray
    scale_nm: FloatArray

    @classmethod
    def of(
        cls,
        equations: CandidateEquations,
        channel: TorqueChannel,
        block_s: float,
        reaches: Sequence[Reach | None] | None = None,
    ) -> Grams:
        """Compute the Gram matrices, weighted by the residuals of Coulomb and viscous friction.

        `reaches` contains the argument `reach` of `CandidateEquations.rows` for each joint; by
        default it follows from `channel`.
        """
        n = equations.joints
        blocks = int(equations.duration_s / block_s) + 1
        responses = [channel.response(piece.frequency_hz) for piece in equations.pieces]
        reaches = reaches_of(channel) if reaches is None else reaches
        grams, counts = [], []
        for j in range(n):
            own = [response[:, j] for response in responses]
            rows = equations.rows(j, ALL_COLUMNS, own, reaches[j], block_s)
            full = np.column_stack([rows.columns, rows.torque_nm])
            gram = np.zeros((blocks, full.shape[1], full.shape[1]))
            for number in np.unique(rows.block):
                x = full[rows.block == number]
                gram[number] = x.T @ x
            grams.append(gram)
            counts.append(np.bincount(rows.block, minlength=blocks))
        plain = cls(
            np.array(grams),
            np.array(counts, dtype=np.float64).T,
            np.arange(len(equations.base)),
            np.ones(n),
        )
        plain = plain._with_identified()
        for _ in range(4):
            plain = plain._reweight(plain.fit([PLAIN] * n))
        return plain

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.gram)

    @property
    def width(self) -> int:
        """Number of columns without friction, including those that are not identified."""
        return int(self.gram.shape[2]) - 1 - len(ALL_COLUMNS)

    def _with_identified(self) -> Grams:
        """Return the Gram matrices, with `rigid` reduced to linearly independent columns."""
        n, p = self.joints, self.width
        total, _ = self._assemble([PLAIN] * n)
        matrix = total.sum(axis=0)
        size = np.sqrt(np.maximum(np.diagonal(matrix), 1e-300))
        matrix = matrix / np.outer(size, size)
        kept: list[int] = []
        # The friction columns come first, because they are always used. Each further column is kept
        # if it is independent of the previous columns.
        basis = np.linalg.cholesky(matrix[p:-1, p:-1] + 1e-14 * np.eye(len(matrix) - p - 1))
        order = list(range(p, len(matrix) - 1))
        for c in range(p):
            if size[c] < 1e-9 * size[:p].max():
                continue
            row = np.linalg.solve(basis, matrix[order, c])
            rest = float(matrix[c, c] - row @ row)
            if rest > RANK**2 * 100.0:
                basis = np.block(
                    [[basis, np.zeros((len(basis), 1))], [row[np.newaxis], np.sqrt([[rest]])]]
                )
                order.append(c)
                kept.append(c)
        return Grams(self.gram, self.rows, np.array(kept, dtype=np.int64), self.scale_nm)

    def _reweight(self, fit: Fit) -> Grams:
        """Return the Gram matrices of rows divided by each joint's held-out residual in a fit."""
        error = np.nansum(fit.errors * self.rows, axis=0) / np.maximum(self.rows.sum(axis=0), 1.0)
        factor = np.sqrt(np.maximum(error, 1e-18 * error.max() + 1e-300))
        gram = self.gram / np.square(factor)[:, np.newaxis, np.newaxis, np.newaxis]
        return Grams(gram, self.rows, self.rigid, self.scale_nm * factor)

    @cached_property
    def _shared(self) -> FloatArray:
        """Gram matrix of the columns without friction and the torque, for each block."""
        at = np.append(self.rigid, -1)
        return np.asarray(sum(gram[:, at[:, np.newaxis], at] for gram in self.gram))

    def _assemble(self, chosen: Sequence[Terms]) -> tuple[FloatArray, list[IntArray]]:
        """Return the Gram matrix of all joints for each block, and the indices of their columns.

        The last index is that of the torque.
        """
        width = len(self.rigid)
        count = width + sum(len(columns_of_terms(own)) for own in chosen) + 1
        total = np.zeros((self.gram.shape[1], count, count))
        ends = np.append(np.arange(width), count - 1)
        total[:, ends[:, np.newaxis], ends] = self._shared
        places, start = [], width
        for j, own in enumerate(chosen):
            local = self._local(own)
            friction = np.arange(start, start + len(local) - len(ends))
            place = np.concatenate([ends[:-1], friction, ends[-1:]])
            rows = self.gram[j][:, local[width:-1, np.newaxis], local]
            total[:, friction[:, np.newaxis], place] = rows
            total[:, place[:, np.newaxis], friction] = rows.transpose(0, 2, 1)
            places.append(place)
            start += len(friction)
        return total, places

    def _local(self, terms: Terms) -> IntArray:
        """Return the indices of a joint's columns in its own Gram matrix; the torque is last."""
        columns = [self.width + ALL_COLUMNS.index(column) for column in columns_of_terms(terms)]
        return np.concatenate([self.rigid, columns, [-1]]).astype(np.int64)

    def fit(self, chosen: Sequence[Terms]) -> Fit:
        """Return the solution for a choice of friction terms.

        Raises:
            np.linalg.LinAlgError: The data do not identify the terms.
        """
        total, places = self._assemble(chosen)
        size = np.sqrt(np.maximum(np.diagonal(total.sum(axis=0))[:-1], 1e-300))
        scaled = total[:, :-1, :-1] / np.outer(size, size)
        torque = total[:, :-1, -1] / size
        matrix, rhs = scaled.sum(axis=0), torque.sum(axis=0)
        inverse = np.linalg.inv(matrix)
        inflation = np.diagonal(inverse)
        if not np.all((inflation > 0.0) & (inflation < MOST_INFLATION)):
            raise np.linalg.LinAlgError("the data do not identify a candidate term")
        theta = inverse @ rhs
        live = np.flatnonzero(self.rows.sum(axis=1))
        others = np.linalg.solve(matrix - scaled[live], (rhs - torque[live])[:, :, np.newaxis])[
            :, :, 0
        ]
        errors = np.full((len(total), self.joints), np.nan)
        extended = np.column_stack([others / size, np.full(len(live), -1.0)])
        for j, place in enumerate(places):
            x = np.zeros((len(total), self.gram.shape[2]))
            x[live[:, np.newaxis], self._local(chosen[j])] = extended[:, place]
            square = np.sum(x * np.matmul(self.gram[j], x[:, :, np.newaxis])[:, :, 0], axis=1)
            floor = 1e-15 * self.gram[j, :, -1, -1]
            rows = self.rows[:, j]
            errors[:, j] = np.where(
                rows > 0.0, np.maximum(square, floor) / np.maximum(rows, 1.0), np.nan
            )
        sigma = deviations(others - theta)
        start, index = len(self.rigid), {}
        for j, own in enumerate(chosen):
            for column in columns_of_terms(own):
                index[j, column] = start
                start += 1
        return Fit(index, theta / size, sigma / size, errors)
