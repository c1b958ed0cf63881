"""Choice of the torque channel's kind and values from the data.

Each joint's equations are solved separately, so that the channel of one joint does not depend on
that of another. The choice has these rules:
- The channel's values are estimated by Gauss-Newton together with all linear parameters. Their
  intervals come from a jackknife over blocks of time.
- All joints have the same kind of channel: the simplest one whose held-out error is not distinctly
  larger than that of the best kind.
- A value is kept if it is distinct from zero.
- Rows that depend on friction at standstill are left out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from scipy.linalg import qr

from acquisition.processing.torque_channel import ChannelKind, ComplexArray, TorqueChannel
from config.arrays import FloatArray, IntArray
from identification.equations.candidate_equations import (
    CandidateEquations,
    JointRows,
    Piece,
    Reach,
    Rigid,
    reaches_of,
)
from identification.equations.friction_columns import Column
from identification.regression.nested_choice import (
    DISTINCT_SIGMAS,
    Gain,
    deviations,
    simplest_model,
)
from identification.validation.common_filter import common_filter

ChannelValue = Literal["delay", "lag", "width"]

VALUES: Final[tuple[ChannelValue, ...]] = ("delay", "lag", "width")
KINDS: Final[dict[ChannelKind, tuple[ChannelValue, ...]]] = {
    "none": (),
    "delay": ("delay",),
    "lag": ("lag",),
    "zero-phase": ("width",),
    "delay + lag": ("delay", "lag"),
}
"""Kinds of channel from the simplest to the richest, with their values."""
KIND_SIGMAS: Final = 2.0
LEAST_KIND_GAIN: Final = 0.01
"""Smallest reduction of the held-out RMS error for which a richer kind is chosen: 1 %."""
LONGEST_DELAY_S: Final = 0.05
LONGEST_LAG_S: Final = 0.08
END_SHARE: Final = 0.98
"""A value above this fraction of its longest value is at the end of its search range."""
SHORTEST_LAG_S: Final = 1e-4
START_S: Final[dict[ChannelValue, float]] = {"delay": 0.0, "lag": 0.004, "width": 0.006}
LARGEST_STEP_S: Final = 0.01
SETTLED_S: Final = 1e-5
MOST_STEPS: Final = 9
AFTER_STANDSTILL_S: Final = 0.16
"""Time left out after standstill: at least twice the longest time constant, `LONGEST_LAG_S`."""
FILTER_SHARE: Final = 0.65
"""Largest ratio of squared errors with and without a filter for which a joint shows it."""
RANK: Final = 1e-7


@dataclass(frozen=True, eq=False)
class JointChannel:
    """Fit of one joint's channel.

    Attributes:
        values_s, sigma_s: The channel's values and standard deviations [s].
        errors: Shape (blocks,). Mean squared error of each block when it is left out of the fit.
        moving_error: Mean squared error on all rows at which the joint moves, including those near
            reversals.
    """

    values_s: dict[ChannelValue, float]
    sigma_s: dict[ChannelValue, float]
    errors: FloatArray
    moving_error: float


def choose_channel(
    equations: CandidateEquations,
    terms: Sequence[Sequence[Column]],
    block_s: float,
    kinds: Sequence[ChannelKind] = tuple(KINDS),
    before: TorqueChannel | None = None,
) -> TorqueChannel:
    """Choose the delays and filters of the recorded torques, by cross-validation.

    Args:
        equations: The recordings.
        terms: Friction columns of each joint.
        block_s: Length of a block that is left out [s].
        kinds: Kinds to compare, from the simplest to the richest; the first is "none".
        before: Delays and filters that the previous round chose; None in the first round. Rows so
            close to a standstill that these affect their torque are left out.
    """
    known = TorqueChannel.none(equations.joints) if before is None else before
    reaches = [
        own._replace(after_s=max(AFTER_STANDSTILL_S, own.after_s)) for own in reaches_of(known)
    ]
    fits: dict[ChannelKind, list[JointChannel]] = {}
    for kind in kinds:
        starts: list[dict[ChannelValue, float]] = [START_S] * equations.joints
        if kind == "delay + lag" and "lag" in fits:
            starts = [{"delay": 0.0, "lag": max(fit.values_s["lag"], 0.002)} for fit in fits["lag"]]
        fits[kind] = [
            fit_joint(
                JointEquations(equations, j, terms[j], reaches[j], block_s),
                {key: starts[j][key] for key in KINDS[kind]},
            )
            for j in range(equations.joints)
        ]
    chosen = _choose_kind({kind: _all_errors(own) for kind, own in fits.items()})
    found = accepted_channel(fits[chosen], fits["none"])
    if "zero-phase" not in kinds:
        return found
    with suppress(np.linalg.LinAlgError):  # too few rows to identify the links' parameters
        return common_filter(equations, terms if before is not None else None, block_s, found)
    return found


def _all_errors(fits: Sequence[JointChannel]) -> FloatArray:
    return np.concatenate([fit.errors for fit in fits])


def _choose_kind(errors: dict[ChannelKind, FloatArray]) -> ChannelKind:
    """Return the simplest of the kinds that are not distinctly worse than the best one.

    A kind other than "none" must be distinctly better than "none".
    """
    none = errors["none"]
    shown: list[ChannelKind] = [
        kind
        for kind, own in errors.items()
        if kind == "none" or Gain.between(none, own).exceeds(KIND_SIGMAS, 0.0)
    ]
    return shown[simplest_model([errors[kind] for kind in shown], KIND_SIGMAS, LEAST_KIND_GAIN)]


def accepted_channel(fits: Sequence[JointChannel], none: Sequence[JointChannel]) -> TorqueChannel:
    """Return the channel with only those values that are distinct from zero.

    A value at the upper end of its search range is only a bound: its standard deviation is set to
    the value itself. It is left out if it does not lower the joint's held-out error.

    A joint shows a filter if the filter also lowers the error at the jumps of friction. This
    distinguishes a filter from an elastic joint, which looks like a zero-phase filter, but only
    away from reversals. A filter is a setting of the drives or of the logger, the same for all
    joints. Therefore:
    - If fewer than half of the joints show a filter, it has another cause. A channel without delays
      and filters is then returned.
    - If at least half show a filter, a joint that does not show it keeps its lag, because the
      torque of a joint that sticks for long has no jumps.
    """
    found = np.zeros((6, len(fits)))
    passes_jumps = np.zeros(len(fits), dtype=np.bool_)
    for j, fit in enumerate(fits):
        passes_jumps[j] = fit.moving_error <= FILTER_SHARE * none[j].moving_error
        if "width" in fit.values_s and not passes_jumps[j]:
            continue
        for place, key in enumerate(VALUES):
            value, sigma = fit.values_s.get(key, 0.0), fit.sigma_s.get(key, 0.0)
            longest_s = LONGEST_DELAY_S if key == "delay" else LONGEST_LAG_S
            if abs(value) >= END_SHARE * longest_s:
                if Gain.between(none[j].errors, fit.errors).exceeds(KIND_SIGMAS, 0.0):
                    found[2 * place : 2 * place + 2, j] = value, abs(value)
            elif abs(value) > DISTINCT_SIGMAS * sigma:
                found[2 * place : 2 * place + 2, j] = value, sigma
    delay, delay_sigma, lag, lag_sigma, width, width_sigma = found
    channel = TorqueChannel(delay, delay_sigma, lag, lag_sigma, width, width_sigma)
    shown = np.count_nonzero(passes_jumps & ((lag != 0.0) | (width != 0.0)))
    few = channel.filters and shown < len(fits) / 2.0
    return TorqueChannel.none(len(fits)) if few else channel


@dataclass(frozen=True, eq=False)
class JointEquations:
    """Equations of a single joint.

    Attributes:
        all: The recordings.
        joint: The joint's index, from 0.
        terms: The joint's friction columns.
        reach: As for `CandidateEquations.rows`.
        block_s: Length of a block that is left out [s].
    """

    all: CandidateEquations
    joint: int
    terms: Sequence[Column]
    reach: Reach
    block_s: float

    def rows(self, responses: Sequence[ComplexArray]) -> JointRows:
        """Return the rows with the columns filtered by a channel."""
        return self.all.rows(self.joint, self.terms, responses, self.reach, self.block_s)

    def moving_error(
        self, responses: Sequence[ComplexArray], places: IntArray, theta: FloatArray
    ) -> float:
        """Return the mean squared error of some parameters on all rows at which the joint moves."""
        squares = []
        for piece, response in zip(self.all.pieces, responses, strict=True):
            use = self.all.moving_rows(piece, self.joint)
            torque = piece.to_rows(self._model(piece, places, theta) * response)
            squares.append((piece.to_rows(piece.torque[:, self.joint]) - torque)[use] ** 2)
        return float(np.mean(np.concatenate(squares)))

    def _model(self, piece: Piece, places: IntArray, theta: FloatArray) -> ComplexArray:
        names: tuple[Column | Rigid, ...] = ("rigid", *self.terms)
        columns = np.concatenate([piece.of(self.joint, name) for name in names], axis=1)
        return np.asarray(columns[:, places] @ theta)

    def filtered_torques(
        self, responses: Sequence[Sequence[ComplexArray]], places: IntArray, theta: FloatArray
    ) -> FloatArray:
        """Return the torque of some parameters after each response, (rows, responses)."""
        found = []
        for piece, own in zip(self.all.pieces, responses, strict=True):
            use = self.all.usable_rows(piece, self.joint, self.reach)
            model = self._model(piece, places, theta)
            found.append(np.stack([piece.to_rows(model * each)[use] for each in own], axis=1))
        return np.concatenate(found)


def fit_joint(equations: JointEquations, start: dict[ChannelValue, float]) -> JointChannel:
    """Fit the channel of one joint, with all its linear parameters.

    Args:
        start: The values to fit, and their starting values [s].
    """
    values, free = dict(start), tuple(start)
    bounds = _bounds_of(free)
    independent: IntArray = np.zeros(0, dtype=np.int64)
    steps = 0
    while True:
        channels = [_responses(piece.frequency_hz, values) for piece in equations.all.pieces]
        rows = equations.rows([own[0] for own in channels])
        if not len(independent):
            independent = _independent_columns(rows.columns)
        basis = np.linalg.qr(rows.columns[:, independent])
        theta: FloatArray = np.asarray(
            np.linalg.solve(basis.R, basis.Q.T @ rows.torque_nm), dtype=np.float64
        )
        rest = rows.torque_nm - basis.Q @ (basis.Q.T @ rows.torque_nm)
        if not free:
            slopes = np.empty((len(rest), 0))
            break
        slopes = equations.filtered_torques([own[1:] for own in channels], independent, theta)
        slopes -= basis.Q @ (basis.Q.T @ slopes)
        before: FloatArray = np.array([values[key] for key in free])
        found = _solve_bounded(slopes, rest, before, bounds)
        step = np.clip(found - before, -LARGEST_STEP_S, LARGEST_STEP_S)
        values = dict(zip(free, (before + step).tolist(), strict=True))
        steps += 1
        if steps == MOST_STEPS or np.all(np.abs(step) < SETTLED_S):
            break
    # A value at its lower bound does not count as a parameter of the fit.
    inner = np.array([value > low for value, (low, _) in zip(values.values(), bounds, strict=True)])
    slopes = slopes[:, np.flatnonzero(inner)]
    moved, errors = _leave_blocks_out(
        np.column_stack([basis.Q, slopes]), rows.torque_nm, rows.block
    )
    sigma = np.full(len(free), math.inf)
    sigma[np.flatnonzero(inner)] = deviations(moved[:, basis.Q.shape[1] :])
    last = [own[0] for own in channels]
    moving_error = equations.moving_error(last, independent, theta)
    return JointChannel(values, dict(zip(free, sigma.tolist(), strict=True)), errors, moving_error)


def _bounds_of(free: Sequence[ChannelValue]) -> list[tuple[float, float]]:
    """Return the lower and the upper bound of each fitted value [s]."""
    # With a lag, a delay is not negative: together they would resemble a zero-phase filter.
    delay_s = (0.0 if "lag" in free else -LONGEST_DELAY_S, LONGEST_DELAY_S)
    return [delay_s if key == "delay" else (SHORTEST_LAG_S, LONGEST_LAG_S) for key in free]


def _solve_bounded(
    slopes: FloatArray,
    rest: FloatArray,
    before: FloatArray,
    bounds: Sequence[tuple[float, float]],
) -> FloatArray:
    """Return the least-squares values within their bounds, shape (values,).

    A value beyond its bound is fixed at the bound, and the others are solved for again, because
    their optimum changes.

    Args:
        slopes: Shape (rows, values). Derivative of the torque with respect to each value.
        rest: Shape (rows,). Torque that is not yet explained.
        before: Shape (values,). The current values.
        bounds: Sequence of (lower, upper). Bounds of each value.
    """
    low, high = (np.array(each) for each in zip(*bounds, strict=True))
    found, free = before.copy(), np.ones(len(before), dtype=np.bool_)
    while free.any():
        held = slopes[:, ~free] @ (found - before)[~free]
        step = np.linalg.lstsq(slopes[:, free], rest - held, rcond=None)[0]
        found[free] = before[free] + step
        beyond = free & ((found < low) | (found > high))
        if not beyond.any():
            break
        found = np.clip(found, low, high)
        free &= ~beyond
    return found


def _responses(frequency_hz: FloatArray, values: dict[ChannelValue, float]) -> list[ComplexArray]:
    """Return the response (bins,) and its derivative with respect to each value, in their order."""
    s = 2j * np.pi * frequency_hz
    delay, lag, width = (values.get(key, 0.0) for key in ("delay", "lag", "width"))
    response = np.exp(-s * delay) / ((1.0 + s * lag) * (1.0 - (s * width) ** 2))
    by: dict[ChannelValue, ComplexArray] = {
        "delay": -s * response,
        "lag": -s / (1.0 + s * lag) * response,
        "width": 2.0 * s**2 * width / (1.0 - (s * width) ** 2) * response,
    }
    return [response, *(by[key] for key in values)]


def _independent_columns(columns: FloatArray) -> IntArray:
    """Return the indices of the linearly independent columns, in the order of the columns."""
    size = np.linalg.norm(columns, axis=0)
    live = np.flatnonzero(size > 1e-9 * size.max(initial=1e-300))
    triangle, order = qr(columns[:, live] / size[live], mode="r", pivoting=True)
    diagonal = np.abs(np.diagonal(triangle))
    return np.sort(live[order[: int(np.count_nonzero(diagonal > RANK * diagonal[0]))]])


def _leave_blocks_out(
    columns: FloatArray, torque_nm: FloatArray, block: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return, for each block, the change of the solution without it, and its mean squared error."""
    gram = columns.T @ columns
    residual = torque_nm - columns @ np.linalg.solve(gram, columns.T @ torque_nm)
    moved, errors = [], []
    for number in np.unique(block):
        own = block == number
        x = columns[own]
        change = np.linalg.lstsq(gram - x.T @ x, x.T @ residual[own], rcond=1e-10)[0]
        moved.append(change)
        errors.append(np.mean((residual[own] + x @ change) ** 2))
    return np.array(moved), np.array(errors)
