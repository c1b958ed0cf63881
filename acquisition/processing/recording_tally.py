"""`RecordingTally`: duration, range and losses of a recording."""

from __future__ import annotations

import numpy as np

from acquisition.motion.samples import Phase
from acquisition.processing.period_table import PeriodCutter
from acquisition.recording.recording import Recording
from config.arrays import FloatArray, IntArray


class RecordingTally:
    """Statistics of a recording that arrives in parts; the memory does not grow.

    Args:
        first: The first part, or the whole recording.

    Attributes:
        head: Common data of all parts, without rows.
        cutter: Periods of the recording, if it is periodic.
        rows, valid_rows: Numbers of all rows, and of rows with a valid answer.
        position_min, position_max, speed, torque: Shape (joints,). Lowest and highest position,
            largest speed and torque of the valid rows [rad or m, per second, N m or N].
        start: Shape (joints,). Position in the first valid row after the approach [rad or m]; None
            before it.
        following_error: Shape (joints,). Largest following error after the approach [rad or m];
            None without set-points.
        last_row: Latest row of the motion; -1 before the motion.
        motion_rows: Number of driven rows of the motion up to `last_row`, without rows that an
            early end skipped.
        last_phase: Phase of the last row.
    """

    def __init__(self, first: Recording) -> None:
        n = len(first.joint_names)
        self.head = first.part(slice(0, 0))
        self.cutter = PeriodCutter()
        self.rows = self.valid_rows = 0
        self.position_min, self.position_max = np.full(n, np.inf), np.full(n, -np.inf)
        self.speed, self.torque = np.zeros(n), np.zeros(n)
        self.start: FloatArray | None = None
        self.following_error = None if first.target_position is None else np.zeros(n)
        self.last_row, self.last_phase = -1, Phase.APPROACH
        self._undriven = 0
        self._last_driven_s: float | None = None
        self._first_s = self._last_s = float(first.time_s[0]) if len(first) else 0.0
        self._before: tuple[FloatArray, FloatArray] = np.empty(0), np.empty((0, n))
        self._answered = np.zeros(n, dtype=np.int64)
        self._answered_last = np.zeros(n, dtype=np.bool_)
        self.add(first)

    def add(self, part: Recording) -> None:
        """Count the rows of the next part of the recording."""
        self.cutter.add(part)
        self.rows += len(part)
        self._last_s = float(part.time_s[-1]) if len(part) else self._last_s
        for piece in part.pieces():
            self._add_valid(piece)
            self._add_motion(piece)

    @property
    def duration_s(self) -> float:
        """Time from the first row to the last [s]."""
        return self._last_s - self._first_s

    @property
    def lost(self) -> tuple[int, ...]:
        """Number of rows of the motion without a valid answer, per joint."""
        return tuple((self.motion_rows - self._answered).tolist())

    @property
    def motion_rows(self) -> int:
        """Number of driven rows of the motion up to `last_row`."""
        return self.last_row + 1 - self._undriven

    def _add_valid(self, part: Recording) -> None:
        good = part.valid
        self.valid_rows += int(np.count_nonzero(good))
        if not good.any():
            return
        position = part.position[good]
        self.position_min = np.minimum(self.position_min, position.min(axis=0))
        self.position_max = np.maximum(self.position_max, position.max(axis=0))
        self.torque = np.maximum(self.torque, np.abs(part.torque_nm[good]).max(axis=0))
        time_s = np.concatenate([self._before[0], part.time_s[good]])
        way = np.concatenate([self._before[1], position])
        self._before = time_s[-1:], way[-1:]
        speed = np.abs(np.diff(way, axis=0) / np.diff(time_s)[:, np.newaxis])
        self.speed = np.maximum(self.speed, speed.max(axis=0, initial=0.0))
        moving = good & (part.phase != Phase.APPROACH)
        if self.start is None and moving.any():
            self.start = part.position[moving][0]
        if self.following_error is not None and part.target_position is not None:
            error = np.abs(part.target_position - part.position)[moving]
            self.following_error = np.maximum(self.following_error, error.max(axis=0, initial=0.0))

    def _add_motion(self, part: Recording) -> None:
        """Count each answered row of the motion once; during a wait, the last row repeats."""
        driven = part.sample_index >= 0
        if not driven.any():
            return
        index = part.sample_index[driven]
        first, last = int(index.min()), int(index.max())
        answered = np.zeros((last - first + 1, len(self._answered)), dtype=np.bool_)
        row, joint = np.nonzero(part.joint_valid[driven])
        answered[index[row] - first, joint] = True
        if first == self.last_row:
            answered[0] |= self._answered_last
            self._answered -= self._answered_last
        self._answered += answered.sum(axis=0)
        self._answered_last = answered[-1]
        self._add_undriven(index, part.time_s[driven])
        self.last_row, self.last_phase = last, Phase(int(part.phase[driven][-1]))

    def _add_undriven(self, index: IntArray, time_s: FloatArray) -> None:
        """Count the rows of skipped periods: the row number jumps, but no time passes."""
        samples = self.head.samples_per_period
        if self.head.sample_period_s is None or samples is None:
            return
        if self._last_driven_s is not None:
            index = np.concatenate([[self.last_row], index])
            time_s = np.concatenate([[self._last_driven_s], time_s])
        cycles = np.maximum(np.rint(np.diff(time_s) / self.head.sample_period_s), 1.0)
        passed = np.maximum(np.diff(index) - cycles, 0.0)
        self._undriven += int(passed[passed % samples == 0.0].sum())
        self._last_driven_s = float(time_s[-1])
