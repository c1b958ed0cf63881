"""`SignalBinner`: reduces the rows of a motion to minima and maxima of short intervals (bins)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.task.joint_values import WINDOW_S

BIN_S: Final = 0.05
"""Duration of a bin [s]: 20 bins per second, whatever the cycle time is."""

LANES: Final = (
    "position_low",
    "position_high",
    "velocity_low",
    "velocity_high",
    "torque_low",
    "torque_high",
    "following_error_low",
    "following_error_high",
    "temperature",
)
"""Values of a bin for each joint, in SI units; the temperature in °C."""

CELL_LANES: Final = ("exchange_low", "exchange_high")
"""Values of a bin for the cell: time from SYNC to the last answer, as a share of the cycle."""

_TIME, _WALL, _SEGMENT, _EXCHANGE, _JOINTS = range(5)


@dataclass(frozen=True)
class SignalBins:
    """Consecutive bins of one motion.

    Attributes:
        end_s: Shape (bins,). Time of the last row in each bin [s since 1970].
        after_gap: Shape (bins,). True if rows are missing between a bin and the bin before it.
        values: Shape (bins, lanes). `CELL_LANES`, then for each of `LANES` one value per joint. NaN
            if there is no value, for example because a drive did not answer.
    """

    end_s: NDArray[np.float64]
    after_gap: NDArray[np.bool_]
    values: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.end_s)


def lanes_of(joints: int) -> int:
    """Return the number of values of a bin."""
    return len(CELL_LANES) + len(LANES) * joints


class SignalBinner:
    """Reduces the rows of one motion; the first bin always counts as the one after a gap.

    Args:
        joints: Number of joints.
        cycle_time_s: Cycle time of the cell [s].
    """

    def __init__(self, joints: int, cycle_time_s: float) -> None:
        self._joints = joints
        self._cycle_time_s = cycle_time_s
        self._gap_s = max(BIN_S, 3.0 * cycle_time_s)
        self._window = max(1, round(WINDOW_S / cycle_time_s))
        self._kept = np.empty((0, _JOINTS + 3 * joints))
        self._binned = 0  # number of kept rows that are already in a bin
        self._segment = 0.0
        self._time_s = np.nan
        self._last_segment = np.nan  # segment of the last bin

    def add(
        self, rows: NDArray[Any], wall_s: NDArray[np.float64], temperature_c: Sequence[float] = ()
    ) -> SignalBins:
        """Return the bins that are complete with new rows.

        Args:
            rows: New rows of the motion (`row_dtype`), oldest first.
            wall_s: Time of each row [s since 1970]; it never decreases.
            temperature_c: Present temperatures of the motors [°C]; empty if they are unknown.
        """
        if len(rows):
            self._kept = np.vstack((self._kept, self._matrix_of(rows, wall_s)))
        return self._close(temperature_c, keep_last=True)

    def finish(self, temperature_c: Sequence[float] = ()) -> SignalBins:
        """Return the last, incomplete bin at the end of the motion."""
        return self._close(temperature_c, keep_last=False)

    def _matrix_of(self, rows: NDArray[Any], wall_s: NDArray[np.float64]) -> NDArray[np.float64]:
        n = self._joints
        matrix = np.empty((len(rows), _JOINTS + 3 * n))
        steps = np.diff(rows["time_s"], prepend=self._time_s)
        is_gap = (steps > self._gap_s) | (steps < 0.0)  # False for the first row, after NaN
        self._time_s = float(rows["time_s"][-1])
        matrix[:, _TIME], matrix[:, _WALL] = rows["time_s"], wall_s
        matrix[:, _SEGMENT] = self._segment + np.cumsum(is_gap)
        self._segment = float(matrix[-1, _SEGMENT])
        matrix[:, _EXCHANGE] = rows["exchange_s"] / self._cycle_time_s
        shape = (len(rows), n)
        position = rows["position"].reshape(shape)
        errors = rows["target_position"].reshape(shape) - position
        torque = rows["torque_nm"].reshape(shape)
        values = np.hstack((position, torque, errors))
        values[np.tile(rows["valid"].reshape(shape) == 0, 3)] = np.nan
        matrix[:, _JOINTS:] = values
        return matrix

    def _close(self, temperature_c: Sequence[float], *, keep_last: bool) -> SignalBins:
        block, first, n = self._kept, self._binned, self._joints
        new = block[first:]
        if not len(new):
            return _no_bins(n)
        numbers = np.floor(new[:, _WALL] / BIN_S)
        changes = (np.diff(numbers) != 0.0) | (np.diff(new[:, _SEGMENT]) != 0.0)
        starts = np.concatenate(([0], 1 + np.flatnonzero(changes)))
        ends = np.append(starts[1:], len(new)) - 1
        if keep_last:
            open_at = first + int(starts[-1])
            starts, ends = starts[:-1], ends[:-1]
        else:
            open_at = len(block)
        begin = max(0, open_at - self._window)
        self._kept, self._binned = block[begin:].copy(), open_at - begin
        if not len(starts):
            return _no_bins(n)
        used = new[: ends[-1] + 1]
        segments = used[ends, _SEGMENT]
        values = np.full((len(starts), lanes_of(n)), np.nan, dtype=np.float32)
        position, torque, error = np.split(used[:, _JOINTS:], 3, axis=1)
        velocity = self._velocity(block, first, len(used))
        exchange = used[:, _EXCHANGE : _EXCHANGE + 1]
        values[:, 0:2] = np.hstack(_extremes(exchange, starts))
        at = len(CELL_LANES)
        for signal in (position, velocity, torque, error):
            values[:, at : at + 2 * n] = np.hstack(_extremes(signal, starts))
            at += 2 * n
        if len(temperature_c) == n:
            values[:, at:] = np.asarray(temperature_c)
        after_gap = np.diff(segments, prepend=self._last_segment) != 0.0
        self._last_segment = float(segments[-1])
        return SignalBins(used[ends, _WALL], after_gap, values)

    def _velocity(self, block: NDArray[np.float64], first: int, count: int) -> NDArray[np.float64]:
        """Return mean velocities over the last `WINDOW_S` before each row; NaN after a gap."""
        columns = slice(_JOINTS, _JOINTS + self._joints)
        found = np.full((count, self._joints), np.nan)
        skipped = max(0, self._window - first)
        if skipped >= count:
            return found
        late = block[first + skipped : first + count]
        early = block[first + skipped - self._window : first + count - self._window]
        elapsed_s = late[:, _TIME] - early[:, _TIME]
        is_whole = (late[:, _SEGMENT] == early[:, _SEGMENT]) & (elapsed_s > 0.0)
        moved = late[:, columns] - early[:, columns]
        found[skipped:][is_whole] = moved[is_whole] / elapsed_s[is_whole, np.newaxis]
        return found


def _extremes(
    values: NDArray[np.float64], starts: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the minima and maxima of groups of rows; NaN values are ignored."""
    return np.fmin.reduceat(values, starts, axis=0), np.fmax.reduceat(values, starts, axis=0)


def _no_bins(joints: int) -> SignalBins:
    values = np.empty((0, lanes_of(joints)), dtype=np.float32)
    return SignalBins(np.empty(0), np.empty(0, dtype=np.bool_), values)
