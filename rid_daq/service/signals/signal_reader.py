"""`SignalReader`: reads the new rows of a motion from the memory of its processes."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from acquisition.journal.cycle_row import row_dtype
from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from acquisition.task.states import Pace
from config.errors import RecordingError
from config.plausible import ZERO_CELSIUS_K
from rid_daq.service.signals.signal_bins import SignalBinner, SignalBins

MOST_SPREAD_S = 0.5


class SignalReader:
    """Reads the rows of one motion; it writes nothing.

    In real time, each row has the time of its SYNC. Simulated time may run faster or slower than
    real time: the rows of a simulated cell are spread evenly between two readings.

    Args:
        ring, control: Shared memory of the motion.
        joints: Names of the joints.
        cycle_time_s: Cycle time of the cell [s].
        monotonic_s, wall_s: Clocks: CLOCK_MONOTONIC, and the time since 1970 [s].

    Raises:
        RecordingError: The names do not fit the rows: the cell's files have changed since the start
            of the motion.
    """

    def __init__(
        self,
        ring: Ring,
        control: ControlBlock,
        joints: tuple[str, ...],
        cycle_time_s: float,
        *,
        monotonic_s: Callable[[], float] = time.monotonic,
        wall_s: Callable[[], float] = time.time,
    ) -> None:
        if len(joints) != ring.joints:
            raise RecordingError(
                f"the motion has {ring.joints} joints, but the cell's files name {len(joints)}: the"
                " files have changed; end the motion to see its live signals again",
                code="RID-CELL-JOINTS",
            )
        self.joints = joints
        self._ring = ring
        self._control = control
        self._dtype = row_dtype(ring.joints)
        self._binner = SignalBinner(ring.joints, cycle_time_s)
        self._next_row = 0
        self._monotonic_s = monotonic_s
        self._offset_s = wall_s() - monotonic_s()
        self._read_s = monotonic_s()

    def read(self) -> SignalBins:
        """Return the bins that are complete since the last call."""
        now_s = self._monotonic_s()
        self._next_row, data = self._ring.rows_from(self._next_row)
        rows = np.frombuffer(data, dtype=self._dtype)
        bins = self._binner.add(rows, self._wall_times(rows["time_s"], now_s), self._temperature())
        self._read_s = now_s
        return bins

    def finish(self) -> SignalBins:
        """Return the last bins, after the end of the motion."""
        bins, last = self.read(), self._binner.finish(self._temperature())
        return SignalBins(
            np.concatenate((bins.end_s, last.end_s)),
            np.concatenate((bins.after_gap, last.after_gap)),
            np.concatenate((bins.values, last.values)),
        )

    def _wall_times(self, time_s: NDArray[np.float64], now_s: float) -> NDArray[np.float64]:
        if self._control.task.pace is Pace.REAL_TIME:
            return time_s + self._offset_s
        before_s = max(self._read_s, now_s - MOST_SPREAD_S)
        share = np.arange(1, len(time_s) + 1) / max(1, len(time_s))
        return self._offset_s + before_s + share * (now_s - before_s)

    def _temperature(self) -> list[float]:
        """Return the motors' temperatures [°C]; empty without a drive monitor that works."""
        control = self._control
        if not control.monitor.working:
            return []
        found = control.monitor.temperatures(control.program.monitored)
        return [value - ZERO_CELSIUS_K for value in found]
