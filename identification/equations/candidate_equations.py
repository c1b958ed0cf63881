"""`CandidateEquations`: the torque equations of recordings with every candidate column.

Torque and columns pass the same low-pass, a Hann window of finite length. The columns also pass the
joint's torque channel. Both filters are applied to the spectrum, which ends at the fourth zero of
the low-pass. The inverse transform then yields only as many rows as the band needs. The column of
sign(v) is filtered like every other column.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, Literal, NamedTuple

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from acquisition.processing.torque_channel import (
    PADDING_S,
    ComplexArray,
    TorqueChannel,
    with_padding,
)
from acquisition.processing.unfiltered import UnfilteredSignals, load_width_s, smooth_gaussian
from config.arrays import BoolArray, FloatArray, IntArray
from config.errors import EstimationError
from dynamics.model.robot_model import RobotModel, regressor
from dynamics.model.standstill import moving_actuators, moving_without_reversal
from dynamics.terms.conditions import Conditions
from identification.equations.friction_columns import Column, friction_column
from identification.model.base_parameters import BaseParameters

CUTOFF_HZ: Final = 8.0
"""Highest -3 dB frequency of the low-pass [Hz]; encoder noise has more effect above it."""
KERNEL_PERIODS: Final = 0.72
"""Length of a Hann window with -3 dB at 1 Hz [s]."""
ZEROS: Final = 4.0
ROW_S: Final = 0.005
"""Longest time between the rows of computed columns [s], unless the recording is slower."""
EDGE_S: Final = 0.5
LONGEST_S: Final = 300.0
"""Largest total length of recordings [s]; of longer ones, each segment is shortened by the same
factor."""

Source = SmoothedSignals | UnfilteredSignals
Rigid = Literal["rigid"]
"""Name for all columns that are not friction columns."""


class Reach(NamedTuple):
    """Time before and after standstill during which a torque depends on unknown friction.

    Attributes:
        before_s, after_s: Time in addition to that of the low-pass [s].
        passed_s: Longest standstill that is ignored [s].
    """

    before_s: float
    after_s: float
    passed_s: float = 0.0


@dataclass(frozen=True, eq=False)
class Piece:
    """One segment of a recording, without a gap.

    Attributes:
        rigid: Shape (rows, n, p). Columns of the model without friction, not filtered.
        speed, load_nm: Shape (rows, n). Speed of the actuators, and the torque that their gears
            transmit.
        step_s: Time between rows [s].
        torque: Shape (bins, n). Spectrum of the low-passed torque.
        low_pass: Shape (bins,). Gain of the low-pass.
        load_width_s: Width of the smoothing of `load_nm`, whose sign must not follow noise [s].
        length: Rows of the padded segment; its period is `length` times `step_s`.
        slow: Shape (rows, n). True if the actuator is too slow for its friction to be known, or
            reverses before the next row or after the previous one.
        held: Shape (rows, n). Row at which each torque was updated, if the source updates it less
            than once per row.
    """

    rigid: FloatArray
    speed: FloatArray
    load_nm: FloatArray
    step_s: float
    torque: ComplexArray
    low_pass: FloatArray
    load_width_s: float
    length: int
    slow: BoolArray
    held: IntArray | None = None
    spectra: dict[tuple[int, Column | Rigid], ComplexArray] = field(default_factory=dict)

    @property
    def frequency_hz(self) -> FloatArray:
        """Frequencies of the spectrum, shape (bins,)."""
        bins = np.arange(len(self.low_pass), dtype=np.float64)
        return np.asarray(bins / (self.length * self.step_s))

    @property
    def time_s(self) -> FloatArray:
        """Times of the rows after the inverse transform, from the first row of the piece."""
        count = self._count
        return np.arange(count, dtype=np.float64) * (self.length * self.step_s / count)

    @cached_property
    def _count(self) -> int:
        """Number of rows, at least two per bin."""
        return _fast_length(2 * (len(self.low_pass) - 1))

    def to_rows(self, spectrum: ComplexArray) -> FloatArray:
        """Return the rows of a spectrum, at the times `time_s`."""
        count = self._count
        return np.asarray(np.fft.irfft(spectrum, count, axis=0) * (count / self.length))

    def spectrum(self, values: FloatArray) -> ComplexArray:
        """Return the low-passed spectrum (bins, any) of columns."""
        bins = np.fft.rfft(with_padding(values, self.length), axis=0)[: len(self.low_pass)]
        return np.asarray(bins * self.low_pass[:, np.newaxis])

    def of(self, joint: int, column: Column | Rigid) -> ComplexArray:
        """Return the spectrum of a joint's column, or of all its columns without friction."""
        key = (joint, column)
        if key not in self.spectra:
            if column == "rigid":
                values = self.rigid[:, joint]
            else:
                values = friction_column(column, self.speed[:, joint], self.load_nm[:, joint])
            if self.held is not None:
                values = values[self.held[:, joint]]
            self.spectra[key] = self.spectrum(values.reshape(len(self.rigid), -1))
        return self.spectra[key]


@dataclass(frozen=True, eq=False)
class JointRows:
    """Rows of one joint's equations.

    Attributes:
        columns: Shape (rows, p + columns). The columns without friction, then the requested
            friction columns.
        torque_nm: Shape (rows,). Torque [N m or N].
        block: Shape (rows,). Index of each row's block of time, counted over all recordings.
    """

    columns: FloatArray
    torque_nm: FloatArray
    block: IntArray


@dataclass(frozen=True, eq=False)
class CandidateEquations:
    """Equations of all recordings.

    Attributes:
        model: The robot without friction and with lossless gears.
        base: Its base parameters.
        pieces: The recordings, segment by segment.
        starts_s: Start of each piece on a common time axis, for the blocks [s].
        cutoff_hz: -3 dB frequency of the low-pass.
    """

    model: RobotModel
    base: BaseParameters
    pieces: tuple[Piece, ...]
    starts_s: tuple[float, ...]
    cutoff_hz: float

    @classmethod
    def of(
        cls,
        model: RobotModel,
        base: BaseParameters,
        signals: Sequence[SmoothedSignals],
        standstill_rad_s: float,
    ) -> CandidateEquations:
        """Compute the columns of some recordings.

        Args:
            model: The robot without friction.
            base: Its base parameters.
            signals: Recordings that are low-passed only by their own `cutoff_hz`.
            standstill_rad_s: Speed above which a joint counts as moving [rad/s or m/s].

        Raises:
            EstimationError: No segment is long enough.
        """
        step_s = max(run.sample_period_s for run in signals)
        cutoff_hz = min(CUTOFF_HZ, 0.09 / step_s, *map(_highest_cutoff_hz, signals))
        total_s = sum(len(run) * run.sample_period_s for run in signals)
        share = min(1.0, LONGEST_S / total_s)
        pieces, starts_s, start_s = [], [], 0.0
        for run in signals:
            source = run.unfiltered or run
            for rows in _segments(source, share):
                pieces.append(_piece(model, base, source, rows, standstill_rad_s, cutoff_hz))
                starts_s.append(start_s)
                start_s += (rows.stop - rows.start) * source.sample_period_s
        if not pieces:
            raise EstimationError(
                f"no segment of the recordings is longer than {4.0 * EDGE_S:g} s without a gap:"
                " use longer recordings for a choice of terms",
                code="RID-RECORDING-SHORT",
            )
        return cls(model, base, tuple(pieces), tuple(starts_s), cutoff_hz)

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.model.joint_names)

    @property
    def duration_s(self) -> float:
        """Total length of the pieces [s]."""
        return sum(len(piece.rigid) * piece.step_s for piece in self.pieces)

    def with_gear_load(self, values: FloatArray) -> CandidateEquations:
        """Return these equations with the gears' load computed from base parameters (b,)."""
        pieces = []
        for piece in self.pieces:
            load_nm = smooth_gaussian(piece.rigid @ values, piece.step_s, piece.load_width_s)
            kept = {key: own for key, own in piece.spectra.items() if key[1] != "load"}
            pieces.append(replace(piece, load_nm=load_nm, spectra=kept))
        return replace(self, pieces=tuple(pieces))

    def rows(
        self,
        joint: int,
        columns: Sequence[Column],
        responses: Sequence[ComplexArray],
        reach: Reach | None,
        block_s: float,
    ) -> JointRows:
        """Return the rows of a joint at which its friction is known.

        Args:
            joint: The joint's index, from 0.
            columns: Friction columns.
            responses: Sequence of ndarray, shape (bins,). Frequency response of the joint's
                channel, one per piece.
            reach: Time around standstill that is left out; None keeps all rows at which the joint
                moves.
            block_s: Length of a block [s].
        """
        parts = [
            self._piece_rows(piece, start_s, joint, columns, response, reach, block_s)
            for piece, start_s, response in zip(self.pieces, self.starts_s, responses, strict=True)
        ]
        return JointRows(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))

    def _piece_rows(
        self,
        piece: Piece,
        start_s: float,
        joint: int,
        columns: Sequence[Column],
        response: ComplexArray,
        reach: Reach | None,
        block_s: float,
    ) -> tuple[FloatArray, FloatArray, IntArray]:
        use = self.usable_rows(piece, joint, reach)
        names: tuple[Column | Rigid, ...] = ("rigid", *columns)
        spectrum = np.concatenate([piece.of(joint, column) for column in names], axis=1)
        matrix = piece.to_rows(spectrum * response[:, np.newaxis])[use]
        torque = piece.to_rows(piece.torque[:, joint])[use]
        block = np.floor((start_s + piece.time_s[use]) / block_s).astype(np.int64)
        return matrix, torque, block

    def moving_rows(self, piece: Piece, joint: int) -> BoolArray:
        """Return a mask of the rows of a piece at which a joint moves."""
        rows, time_s = len(piece.slow), piece.time_s
        at = np.clip(np.round(time_s / piece.step_s).astype(np.int64), 0, rows - 1)
        inside = (time_s > EDGE_S) & (time_s < rows * piece.step_s - EDGE_S)
        return np.asarray(~piece.slow[at, joint] & inside)

    def usable_rows(self, piece: Piece, joint: int, reach: Reach | None) -> BoolArray:
        """Return a mask of the rows of a piece at which a joint's friction is known."""
        if reach is None:
            return self.moving_rows(piece, joint)
        slow = _long_runs(
            piece.slow[:, joint : joint + 1], math.floor(reach.passed_s / piece.step_s)
        )
        # A standstill affects all rows within half the length of the low-pass and of the channel's
        # response.
        kernel_s = KERNEL_PERIODS / 2.0 / self.cutoff_hz
        clear = _rows_away_from(
            piece, slow, Reach(kernel_s + reach.before_s, kernel_s + reach.after_s)
        )
        time_s, end_s = piece.time_s, len(piece.slow) * piece.step_s
        return np.asarray(clear & (time_s > EDGE_S) & (time_s < end_s - EDGE_S))


def _long_runs(mask: BoolArray, passed: int) -> BoolArray:
    """Return the mask (samples, n) without its sequences of at most `passed` true rows."""
    from scipy import ndimage  # a large import, which few recordings need

    return np.asarray(ndimage.binary_opening(mask, np.ones((passed + 1, 1), bool)))


def _rows_away_from(piece: Piece, slow: BoolArray, reach: Reach) -> BoolArray:
    """Return a mask of the rows of a piece that have no slow row within `reach`."""
    counts = np.concatenate([[0], np.cumsum(slow)])
    first = np.floor((piece.time_s - reach.after_s) / piece.step_s).astype(np.int64)
    last = np.ceil((piece.time_s + reach.before_s) / piece.step_s).astype(np.int64)
    rows = len(slow)
    return np.asarray(counts[np.clip(last + 1, 0, rows)] == counts[np.clip(first, 0, rows)])


def reaches_of(channel: TorqueChannel) -> tuple[Reach, ...]:
    """Return the time around standstill that each joint's torque channel affects."""
    times_s = (channel.before_s, channel.after_s, channel.passed_s)
    return tuple(Reach(*own) for own in np.stack(times_s, axis=1).tolist())


def _highest_cutoff_hz(run: SmoothedSignals) -> float:
    """Return the highest -3 dB frequency that a recording allows [Hz].

    A mean period is known only up to its own cut-off.
    """
    if run.unfiltered is not None:
        return math.inf
    return (
        KERNEL_PERIODS / 2.0 * run.cutoff_hz
    )  # the first zero of the window is at the recording's cut-off


def _segments(run: Source, share: float) -> Iterator[slice]:
    """Yield the first `share` of the rows of each segment that is long enough."""
    edges = np.flatnonzero(np.diff(run.segment, prepend=-1, append=-1))
    for start, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        rows = int(share * (end - start))
        if rows * run.sample_period_s > 4.0 * EDGE_S:
            yield slice(start, start + rows)


def _piece(
    model: RobotModel,
    base: BaseParameters,
    run: Source,
    rows: slice,
    standstill_rad_s: float,
    cutoff_hz: float,
) -> Piece:
    held = run.torque_row if isinstance(run, UnfilteredSignals) else None
    stride = 1 if held is not None else max(1, math.floor(ROW_S / run.sample_period_s + 1e-6))
    count = (rows.stop - rows.start) // stride
    rows = slice(rows.start, rows.start + count * stride)
    thin = slice(rows.start, rows.stop, stride)
    step_s = stride * run.sample_period_s
    length = _fast_length(count + math.ceil(PADDING_S / step_s))
    motion = (run.position[thin], run.velocity[thin], run.acceleration[thin])
    conditions = Conditions(payload=False)
    rigid = base.columns(regressor(model, *motion, conditions))
    length_s = length * step_s
    kernel_s = KERNEL_PERIODS / cutoff_hz
    highest_hz = min(ZEROS / kernel_s, 0.5 / step_s)
    frequency_hz = np.arange(math.floor(highest_hz * length_s) + 1) / length_s
    low_pass = _hann(frequency_hz * kernel_s)
    torque = np.fft.rfft(with_padding(run.torque_nm[rows], length * stride), axis=0)
    speed = model.actuator_speed(run.velocity[thin])
    # Reversals are found in the unfiltered velocity: in a low-passed velocity they are at a wrong
    # time.
    of_rows = moving_without_reversal if isinstance(run, UnfilteredSignals) else moving_actuators
    return Piece(
        rigid=rigid,
        speed=speed,
        load_nm=np.zeros_like(speed),
        step_s=step_s,
        torque=torque[: len(low_pass)] * low_pass[:, np.newaxis] / stride,
        low_pass=low_pass,
        load_width_s=load_width_s(cutoff_hz) if isinstance(run, UnfilteredSignals) else 0.0,
        length=length,
        slow=~of_rows(model, run.velocity[thin], standstill_rad_s),
        held=None if held is None else np.maximum(held[rows] - rows.start, 0),
    )


def _fast_length(rows: int) -> int:
    """Return a number of rows, at least `rows`, whose FFT is fast: a product of small primes."""
    from scipy.fft import next_fast_len  # a large import, which few recordings need

    return int(next_fast_len(rows, real=True))


def _hann(periods: FloatArray) -> FloatArray:
    """Return the gain of a Hann window of unit sum; frequencies are periods per window length."""
    away = np.where(np.isclose(periods, 1.0), 0.5, 1.0 / (1.0 - np.square(periods) + 1e-300))
    return np.where(np.isclose(periods, 1.0), 0.5, np.sinc(periods) * away)
