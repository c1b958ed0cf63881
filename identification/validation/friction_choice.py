"""Friction terms of each joint, chosen from the data by forward selection and elimination.

The joints' equations are coupled by the links' parameters. Candidates are columns of these
equations, so that every model is a choice among the entries of one Gram matrix per block, and so is
its error on a block that was left out of the fit. Stribeck friction is tried at a few speeds,
each with the derivative of its curve by the speed. Load-dependent friction is tried alone and
together with Stribeck friction, since each can hide the other; so are terms that bend with speed.
A candidate that the data do not identify is skipped; the plain model (Coulomb and viscous friction)
is always a result.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.processing.torque_channel import TorqueChannel
from config.arrays import FloatArray, IntArray
from config.robot.friction_terms import FrictionTerm
from identification.equations.candidate_equations import (
    ALL_COLUMNS,
    SPEEDS_RAD_S,
    CandidateEquations,
    Column,
)
from identification.validation.nested_choice import (
    DISTINCT_SIGMAS,
    LEAST_GAIN,
    Gain,
    deviations,
    simplest,
)

Terms = tuple[Column, ...]

PLAIN: Final[Terms] = ("coulomb", "viscous")
ROUNDS: Final = 4
MOST_ELIMINATIONS: Final = 12
CLEAR_SIGMAS: Final = 2.0
CLEAR_GAIN: Final = 0.1
CLEAR_GAIN_SIGMAS: Final = 3.0
MOST_INFLATION: Final = 1e9
"""Largest factor by which other columns may inflate a value's variance: 1e9 is no information."""
RANK: Final = 1e-7
_POSITIVE: Final[tuple[FrictionTerm, ...]] = ("stribeck", "load")
_SINGLE: Final[tuple[FrictionTerm, ...]] = ("offset", "cubic", "cube_root", "load")
CANDIDATES: Final[tuple[Terms, ...]] = (
    *((name,) for name in _SINGLE),
    *((("stribeck", speed),) for speed in SPEEDS_RAD_S),
    ("cubic", "cube_root"),
    *((name, ("stribeck", speed)) for name in ("load", "cube_root") for speed in SPEEDS_RAD_S),
)
"""Terms that are tried together beside those that a joint has."""


def name_of(column: Column) -> FrictionTerm:
    """Return the friction term of a column."""
    return column if isinstance(column, str) else "stribeck"


def columns_of(terms: Sequence[Column]) -> Terms:
    """Return the columns of some terms: beside Stribeck friction its slope by the speed."""
    return (*terms, *(("slope", term[1]) for term in terms if isinstance(term, tuple)))


@dataclass(frozen=True, eq=False)
class Fit:
    """Solution of one choice of terms.

    Attributes
    ----------
    places : dict
        Place of each joint's column among the values.
    values, sigma : ndarray, shape (c,)
        Parameters and standard deviations.
    errors : ndarray, shape (blocks, n)
        Mean squared error of each block in a fit of all others; NaN without rows.
    """

    places: dict[tuple[int, Column], int]
    values: FloatArray
    sigma: FloatArray
    errors: FloatArray

    def distance(self, joint: int, column: Column) -> float:
        """Return a value over its standard deviation."""
        at = self.places[joint, column]
        return float(self.values[at] / max(self.sigma[at], 1e-300))

    def value(self, joint: int, column: Column) -> float:
        """Return the value of a joint's column."""
        return float(self.values[self.places[joint, column]])


@dataclass(frozen=True, eq=False)
class Grams:
    """Gram matrices of the joints' equations, block by block.

    Attributes
    ----------
    gram : ndarray, shape (n, blocks, w, w)
        Of [columns without friction, `ALL_COLUMNS`, torque] of each joint over its scale.
    rows : ndarray, shape (blocks, n)
        Rows of each.
    rigid : ndarray of int64, shape (p,)
        The columns without friction that the data identify.
    scale_nm : ndarray, shape (n,)
        What the rows of each joint were divided by.
    """

    gram: FloatArray
    rows: FloatArray
    rigid: IntArray
    scale_nm: FloatArray

    @classmethod
    def of(cls, equations: CandidateEquations, channel: TorqueChannel, block_s: float) -> Grams:
        """Compute them, weighted by the residuals of the plain model."""
        n = equations.joints
        blocks = int(equations.duration_s / block_s) + 1
        responses = [channel.response(piece.frequency_hz) for piece in equations.pieces]
        grams, counts = [], []
        for j in range(n):
            reach_s = float(channel.before_s[j]), float(channel.after_s[j])
            own = [response[:, j] for response in responses]
            rows = equations.rows(j, ALL_COLUMNS, own, reach_s, block_s)
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
            plain = plain._reweighted(plain.fit([PLAIN] * n))
        return plain

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.gram)

    @property
    def width(self) -> int:
        """Number of columns without friction, identified or not."""
        return int(self.gram.shape[2]) - 1 - len(ALL_COLUMNS)

    def _with_identified(self) -> Grams:
        """Return them with the columns without friction that are independent of all others."""
        n, p = self.joints, self.width
        total, _ = self._assembled([PLAIN] * n, np.arange(p))
        matrix = total.sum(axis=0)
        size = np.sqrt(np.maximum(np.diagonal(matrix), 1e-300))
        matrix = matrix / np.outer(size, size)
        kept: list[int] = []
        # Friction first, which is always there; then every column that adds something.
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

    def _reweighted(self, fit: Fit) -> Grams:
        """Return them over the held-out residuals of a fit."""
        error = np.nansum(fit.errors * self.rows, axis=0) / np.maximum(self.rows.sum(axis=0), 1.0)
        factor = np.sqrt(np.maximum(error, 1e-18 * error.max() + 1e-300))
        gram = self.gram / np.square(factor)[:, np.newaxis, np.newaxis, np.newaxis]
        return Grams(gram, self.rows, self.rigid, self.scale_nm * factor)

    def _assembled(
        self, chosen: Sequence[Terms], rigid: IntArray
    ) -> tuple[FloatArray, list[IntArray]]:
        """Return each block's matrix of all joints together, and each joint's places in it.

        The last place is the torque's.
        """
        p, width = self.width, len(rigid)
        count = width + sum(len(columns_of(own)) for own in chosen) + 1
        total = np.zeros((self.gram.shape[1], count, count))
        places, start = [], width
        for j, own in enumerate(chosen):
            columns = columns_of(own)
            local = np.concatenate(
                [rigid, [p + ALL_COLUMNS.index(column) for column in columns], [-1]]
            ).astype(np.int64)
            place = np.concatenate(
                [np.arange(width), start + np.arange(len(columns)), [count - 1]]
            ).astype(np.int64)
            total[:, place[:, np.newaxis], place] += self.gram[j][:, local[:, np.newaxis], local]
            places.append(place)
            start += len(columns)
        return total, places

    def _local(self, terms: Terms) -> IntArray:
        """Return the places of a joint's columns in its own Gram matrix, the torque's last."""
        columns = [self.width + ALL_COLUMNS.index(column) for column in columns_of(terms)]
        return np.concatenate([self.rigid, columns, [-1]]).astype(np.int64)

    def fit(self, chosen: Sequence[Terms]) -> Fit:
        """Return the solution of some terms.

        Raises
        ------
        np.linalg.LinAlgError
            The data do not identify them.
        """
        total, places = self._assembled(chosen, self.rigid)
        size = np.sqrt(np.maximum(np.diagonal(total.sum(axis=0))[:-1], 1e-300))
        scaled = total[:, :-1, :-1] / np.outer(size, size)
        torque = total[:, :-1, -1] / size
        matrix, rhs = scaled.sum(axis=0), torque.sum(axis=0)
        inverse = np.linalg.inv(matrix)
        inflation = np.diagonal(inverse)
        if not np.all((inflation > 0.0) & (inflation < MOST_INFLATION * 1e3)):
            raise np.linalg.LinAlgError("a candidate is not identified")
        theta = inverse @ rhs
        live = np.flatnonzero(self.rows.sum(axis=1))
        others = np.linalg.solve(matrix - scaled[live], (rhs - torque[live])[:, :, np.newaxis])[
            :, :, 0
        ]
        errors = np.full((len(total), self.joints), np.nan)
        extended = np.column_stack([others / size, np.full(len(live), -1.0)])
        for j, place in enumerate(places):
            x = extended[:, place]
            local = self._local(chosen[j])
            gram = self.gram[j][live][:, local[:, np.newaxis], local]
            square = np.einsum("bi,bij,bj->b", x, gram, x)
            floor = 1e-15 * gram[:, -1, -1]
            rows = self.rows[live, j]
            errors[live, j] = np.where(
                rows > 0.0, np.maximum(square, floor) / np.maximum(rows, 1.0), np.nan
            )
        sigma = deviations(others - theta)
        start, index = len(self.rigid), {}
        for j, own in enumerate(chosen):
            for column in columns_of(own):
                index[j, column] = start
                start += 1
        return Fit(index, theta / size, sigma / size, errors)


@dataclass(frozen=True, eq=False)
class FrictionChoice:
    """The chosen terms of each joint.

    Attributes
    ----------
    terms : tuple of tuple of Column
        Of each joint.
    fit, plain : Fit
        Solutions of these terms and of the plain model.
    """

    terms: tuple[Terms, ...]
    fit: Fit
    plain: Fit


def choose_terms(grams: Grams) -> FrictionChoice:
    """Choose each joint's friction terms.

    Parameters
    ----------
    grams : Grams
        The equations, their torque channel known.
    """
    n = grams.joints
    chosen: list[Terms] = [PLAIN] * n
    plain = now = grams.fit(chosen)
    candidates = set(range(n))
    for _ in range(ROUNDS):
        added = {j: extra for j in sorted(candidates) if (extra := _best(grams, chosen, j, now))}
        if not added:
            break
        tried = [own + added.get(j, ()) for j, own in enumerate(chosen)]
        fit = _fit_or_none(grams, tried)
        if fit is None:
            break
        chosen, now, candidates = tried, fit, set(added)
    for _ in range(MOST_ELIMINATIONS):
        worst = _weakest(grams, chosen, now)
        if worst is None:
            break
        j, term = worst
        chosen[j] = tuple(own for own in chosen[j] if own != term)
        now = grams.fit(chosen)
    # Terms that help other blocks' joints only are no gain: such a joint returns to plain.
    worse = [j for j in range(n) if np.nanmean(now.errors[:, j]) > np.nanmean(plain.errors[:, j])]
    if any(chosen[j] != PLAIN for j in worse):
        chosen = [PLAIN if j in worse else own for j, own in enumerate(chosen)]
        now = grams.fit(chosen)
    return FrictionChoice(tuple(chosen), now, plain)


def _fit_or_none(grams: Grams, chosen: Sequence[Terms]) -> Fit | None:
    try:
        return grams.fit(chosen)
    except np.linalg.LinAlgError:
        return None


def _trials(grams: Grams, chosen: Sequence[Terms], joint: int) -> Iterator[tuple[Terms, Fit]]:
    """Yield what can be added to a joint's terms, as far as the data identify it."""
    have = {name_of(term) for term in chosen[joint]}
    for extra in CANDIDATES:
        if have.isdisjoint(map(name_of, extra)):
            tried = [own + extra if j == joint else own for j, own in enumerate(chosen)]
            fit = _fit_or_none(grams, tried)
            if fit is not None:
                yield extra, fit


def _best(grams: Grams, chosen: Sequence[Terms], joint: int, now: Fit) -> Terms:
    """Return the fewest terms to add to a joint's that are not worse than the best; () for none."""
    good = []
    for extra, fit in _trials(grams, chosen, joint):
        found = Gain.between(now.errors[:, joint], fit.errors[:, joint])
        if (
            _is_braking(fit, joint)
            and all(_is_shown(fit, joint, term, found) for term in extra)
            and found.exceeds(least=LEAST_GAIN * len(extra))
        ):
            good.append((extra, fit))
    if not good:
        return ()

    def gain(trial: tuple[Terms, Fit]) -> float:
        return Gain.between(now.errors[:, joint], trial[1].errors[:, joint]).mean

    good.sort(key=lambda trial: (len(trial[0]), -gain(trial)))
    first = simplest([fit.errors[:, joint] for _, fit in good])
    fewest = len(good[first][0])
    return max((trial for trial in good if len(trial[0]) == fewest), key=gain)[0]


def _is_braking(fit: Fit, joint: int) -> bool:
    """Return True if Coulomb and viscous friction brake: others may not take their place."""
    return all(fit.value(joint, term) > 0.0 for term in PLAIN)


def _is_shown(fit: Fit, joint: int, term: Column, gain: Gain) -> bool:
    """Return True if a term is distinct from zero, and positive if it must be.

    A term that clearly lowers the error on data left out of the fit needs less: few blocks, as in
    half a minute of data, give wide deviations.
    """
    if name_of(term) in _POSITIVE and fit.value(joint, term) <= 0.0:
        return False
    clear = gain.exceeds(CLEAR_GAIN_SIGMAS, CLEAR_GAIN)
    return abs(fit.distance(joint, term)) > (CLEAR_SIGMAS if clear else DISTINCT_SIGMAS)


def _weakest(grams: Grams, chosen: Sequence[Terms], now: Fit) -> tuple[int, Column] | None:
    """Return the term that is least distinct from zero among those not worth their place."""
    weak: list[tuple[float, int, Column]] = []
    for j, own in enumerate(chosen):
        for term in own[len(PLAIN) :]:
            left: Terms = tuple(other for other in own if other != term)
            fit = grams.fit([*chosen[:j], left, *chosen[j + 1 :]])
            gain = Gain.between(fit.errors[:, j], now.errors[:, j])
            if not (_is_shown(now, j, term, gain) and gain.exceeds()):
                weak.append((abs(now.distance(j, term)), j, term))
    if not weak:
        return None
    _, j, term = min(weak, key=lambda each: each[0])
    return j, term
