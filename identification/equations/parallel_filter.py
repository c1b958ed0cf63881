"""`ParallelFilter`: the low-pass that is applied to a recording's torque and to all columns alike.

If tau = X(q, v, a) theta, then h * tau = (h * X) theta for every linear filter h. Therefore the
same filter is applied to the torque and to the columns. The columns of a recording are computed
from its unfiltered signals (`UnfilteredSignals`). The signals of a mean period contain only
frequencies below its cut-off; its columns are computed from these signals and filtered at the same
cut-off.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals, low_pass
from acquisition.processing.unfiltered import (
    SMOOTHING_REACH,
    UnfilteredSignals,
    load_width_s,
    smooth_gaussian,
    window_mean,
    window_reach,
)
from config.arrays import PIECE_ROWS, BoolArray, FloatArray, IntArray
from dynamics.model.memory import (
    presliding_of_model,
    samples_with_known_friction,
    with_presliding_history,
)
from dynamics.model.robot_model import RobotModel, load_torque
from dynamics.model.standstill import moving_actuators, moving_without_reversal
from dynamics.terms.conditions import Conditions
from identification.equations.torque_kinks import integrable_torque

FILTER_REACH: Final = 3.0
"""Duration of a Butterworth low-pass's transient [periods of its cut-off]."""


@dataclass(frozen=True, eq=False)
class ParallelFilter:
    """The filter of one recording or mean period.

    Attributes:
        signals: The recording, or a part of a recording.
    """

    signals: SmoothedSignals

    @property
    def source(self) -> SmoothedSignals | UnfilteredSignals:
        """The signals from which the columns are computed."""
        return self.signals.unfiltered or self.signals

    @property
    def limit_hz(self) -> float | None:
        """Cut-off of the Butterworth low-pass of the columns, or None."""
        signals = self.signals
        if signals.unfiltered is None:
            return signals.cutoff_hz
        return signals.unfiltered.torque_limit_hz

    def motion(self, rows: slice) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return q, v and a of some rows of the source, as kernels need them: in C order."""
        source = self.source
        motion = (source.position, source.velocity, source.acceleration)
        q, v, a = (np.ascontiguousarray(values[rows]) for values in motion)
        return q, v, a

    def load_nm(
        self, model: RobotModel, standard: FloatArray, rows: slice, own: Conditions
    ) -> FloatArray:
        """Return the torque that each gear transmits, whose sign is the direction of its losses.

        The acceleration is smoothed, because the noise of a position's second derivative changes
        the sign of a small load, and so increases the loss.

        Args:
            model: The robot.
            standard: Shape (p,). Its parameters.
            rows: Rows of the source, of one segment.
            own: Conditions of these rows.

        Returns:
            (rows, n) array [N m or N].
        """
        q, v, a = self.motion(rows)
        source = self.signals.unfiltered
        if source is not None:
            width_s = load_width_s(self.signals.cutoff_hz)
            reach = math.ceil(SMOOTHING_REACH * width_s / source.sample_period_s)
            number = int(source.segment[rows.start])
            first, end = np.searchsorted(source.segment, [number, number + 1]).tolist()
            start = max(first, rows.start - reach)
            near = np.asarray(source.acceleration[start : min(end, rows.stop + reach)])
            smooth = smooth_gaussian(near, source.sample_period_s, width_s)
            a = np.ascontiguousarray(smooth[rows.start - start :][: len(q)])
        return load_torque(model, q, v, a, standard, own)

    def whole_load_nm(self, model: RobotModel, standard: FloatArray, own: Conditions) -> FloatArray:
        """Return `load_nm` of all rows of the source, (samples, n) [N m or N]."""
        parts = [slice(first, end) for first, end in _segments(self.source.segment)]
        return np.concatenate(
            [self.load_nm(model, standard, rows, own.part(rows)) for rows in parts]
        )

    def conditions(self, model: RobotModel, own: Conditions) -> Conditions:
        """Return the conditions of the source's rows, including presliding hysteresis.

        The hysteresis follows the low-passed position, because an encoder that toggles between two
        counts is not a reversal.
        """
        signals, source = self.signals, self.signals.unfiltered
        if source is None:
            return with_presliding_history(model, signals.position, own, signals.segment)
        if own.temperature_k is not None and np.ndim(own.temperature_k) == 2:
            warmth = [
                np.interp(source.time_s, signals.time_s, each) for each in own.temperature_k.T
            ]
            own = replace(own, temperature_k=np.stack(warmth, axis=1))
        if not presliding_of_model(model):
            return own
        path = np.empty_like(source.position)
        for number in np.unique(source.segment):
            rows = source.segment == number
            path[rows] = low_pass(source.position[rows], source.sample_period_s, signals.cutoff_hz)
        return with_presliding_history(model, path, own, source.segment)

    def window(self, rows: IntArray) -> tuple[slice, IntArray]:
        """Return the range of source rows that affect `rows`, and the places of `rows` in it.

        Args:
            rows: Shape (wanted,). Ascending rows of the signals, of one segment.
        """
        source, wanted, reach = self.source, self._places(rows), 0
        if (limit_hz := self.limit_hz) is not None:
            reach = math.ceil(FILTER_REACH / (limit_hz * source.sample_period_s))
        if self.signals.unfiltered is not None:
            reach += window_reach(source.sample_period_s, self.signals.cutoff_hz)
            reach += self.signals.unfiltered.held_rows
        reach += max(self._channel_reach())
        number = int(source.segment[wanted[0]])
        first, end = np.searchsorted(source.segment, [number, number + 1])
        start = max(int(first), int(wanted[0]) - reach)
        return slice(start, min(int(end), int(wanted[-1]) + reach + 1)), wanted - start

    @property
    def has_channel(self) -> bool:
        """True if `apply_channel` changes columns."""
        source = self.signals.unfiltered
        return self.signals.channel is not None or (
            source is not None and source.torque_row is not None
        )

    def apply_channel(self, values: FloatArray, joint: int, wide: slice) -> FloatArray:
        """Apply the recording process of a joint's torque to the joint's columns.

        The columns pass the torque's channel, and are held between updates of the torque.

        Args:
            values: Shape (source rows, any). Columns of one joint.
            joint: The joint's index, from 0.
            wide: The source's rows of the window.
        """
        source = self.signals.unfiltered
        if self.signals.channel is not None:
            step_s = self.source.sample_period_s
            values = self.signals.channel.of_joint(values, joint, step_s)
        if source is None or source.torque_row is None:
            return values
        return np.asarray(values[np.maximum(source.torque_row[wide, joint] - wide.start, 0)])

    def columns(self, values: FloatArray, places: IntArray) -> FloatArray:
        """Filter the columns (source rows, any) of a window, and return some of its rows."""
        step_s = self.source.sample_period_s
        if (limit_hz := self.limit_hz) is not None:
            values = low_pass(values, step_s, limit_hz)
        if self.signals.unfiltered is None:
            return values[places]
        return window_mean(values, places, step_s, self.signals.cutoff_hz)

    def torque(self, rows: IntArray) -> FloatArray:
        """Return the torque of some rows, filtered like the columns, (rows, n) [N m or N]."""
        source = self.signals.unfiltered
        if source is None:
            return self.signals.torque_nm[rows]
        wide, places = self.window(rows)
        torque_nm = source.torque_nm[wide]
        if self._instantaneous:
            torque_nm = integrable_torque(torque_nm, *self.motion(wide)[:2])
        return window_mean(torque_nm, places, source.sample_period_s, self.signals.cutoff_hz)

    def usable_rows(
        self,
        model: RobotModel,
        whole: Conditions,
        standstill_rad_s: float,
    ) -> tuple[BoolArray, BoolArray]:
        """Return masks of the usable rows and of the rows in motion, each (samples, n).

        Args:
            model: The robot.
            whole: Conditions of the source's rows, including presliding hysteresis.
            standstill_rad_s: Below this speed a joint counts as standing still.
        """
        signals, source = self.signals, self.source
        of_rows = moving_actuators if signals.unfiltered is None else moving_without_reversal
        moves = np.empty(source.velocity.shape, dtype=np.bool_)
        for first in range(0, len(moves), PIECE_ROWS):
            before = min(first, 1)  # a row depends on the rows beside it
            velocity = source.velocity[first - before : first + PIECE_ROWS + 1]
            own = of_rows(model, velocity, standstill_rad_s)[before : before + PIECE_ROWS]
            moves[first : first + PIECE_ROWS] = own
            signals.release()
        known, reach = moves, 0
        if signals.unfiltered is not None:
            reach = signals.unfiltered.reach(signals.cutoff_hz)
            limit_hz = signals.unfiltered.torque_limit_hz
            reach += 0 if limit_hz is None else self._rows(1.0 / limit_hz)
        before, after = self._channel_reach()
        if reach + before + after:
            known = ~_rows_near(~self._known(moves), source.segment, reach + before, reach + after)
        pause = self._rows(1.0 / signals.cutoff_hz)
        use = samples_with_known_friction(whole, known) & _rows_near(
            moves, source.segment, pause, pause
        )
        rows = self._places(np.arange(len(signals)))
        return use[rows], moves[rows]

    @property
    def _instantaneous(self) -> bool:
        """True if each row's torque is a new sample that no filter has changed."""
        source, channel = self.signals.unfiltered, self.signals.channel
        if source is None or (channel is not None and channel.changes):
            return False
        unheld = source.torque_row is None and source.torque_limit_hz is None
        return unheld and source.smoothing_s == 0.0

    def _known(self, moves: BoolArray) -> BoolArray:
        """Return a mask of rows: the joint moves, and moved when its torque was updated."""
        source = self.signals.unfiltered
        if source is None or source.torque_row is None:
            return moves
        return np.asarray(moves & np.take_along_axis(moves, source.torque_row, axis=0))

    def _channel_reach(self) -> tuple[int, int]:
        """Return how many rows before and after an event have a torque that depends on it."""
        channel = self.signals.channel
        if channel is None or not channel.changes:
            return 0, 0
        return self._rows(float(channel.before_s.max())), self._rows(float(channel.after_s.max()))

    def _places(self, rows: IntArray) -> IntArray:
        own = self.signals.unfiltered_row
        return rows if own is None else own[rows]

    def _rows(self, time_s: float) -> int:
        return math.ceil(time_s / self.source.sample_period_s)


def _segments(segment: IntArray) -> Iterator[tuple[int, int]]:
    """Return the first row of each segment, and the row after its last one."""
    edges = (np.flatnonzero(np.diff(segment)) + 1).tolist()
    return pairwise([0, *edges, len(segment)])


def _rows_near(marked: BoolArray, segment: IntArray, ahead: int, behind: int) -> BoolArray:
    """Return a mask of the rows up to `ahead` rows before or `behind` rows after a marked row.

    Marked rows of other segments do not count.
    """
    near = np.zeros_like(marked)
    for first, end in _segments(segment):
        for start in range(first, end, PIECE_ROWS):  # piece by piece, to limit the memory
            stop = min(start + PIECE_ROWS, end)
            begin, beyond = max(start - behind, first), min(stop + ahead, end)
            counts = np.zeros((beyond - begin + 1, marked.shape[1]), dtype=np.int64)
            np.cumsum(marked[begin:beyond], axis=0, out=counts[1:])
            rows = np.arange(start, stop)
            before = np.maximum(rows - behind, begin) - begin
            after = np.minimum(rows + ahead + 1, beyond) - begin
            near[start:stop] = counts[after] > counts[before]
    return near
