"""`Lockstep`: makes simulated time wait for other processes, up to a timeout."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from acquisition.task.states import RecorderState
from config.cell.cell import CellConfig

RECORDER_PATIENCE_S = 30.0
JUDGE_PATIENCE_S = 60.0
MONITOR_PATIENCE_S = 20.0
PAUSE_S = 0.001


class Lockstep:
    """Waits of the cyclic task for other processes; each wait has a timeout.

    Args:
        control: State of the motion's processes.
        ring: Receives one row per cycle.
        cell: Cycle time, and the period of the drive monitor if there is one.
        stopped: Function that returns True if a stop was ordered; then the waits end.
    """

    def __init__(
        self, control: ControlBlock, ring: Ring, cell: CellConfig, stopped: Callable[[], bool]
    ) -> None:
        self._control = control
        self._ring = ring
        self._stopped = stopped
        self._monitored = bool(control.program.monitored) and cell.monitor is not None
        period_s = math.inf if cell.monitor is None else cell.monitor.period_s
        self._least_s = period_s - 0.5 * cell.cycle_time_s
        self._requested_s = -math.inf

    def wait_for_room(self) -> bool:
        """Wait until the ring has room; return False on a failure or timeout."""
        control = self._control
        until_s = time.monotonic() + RECORDER_PATIENCE_S
        while time.monotonic() < until_s:
            if self._ring.waiting < self._ring.capacity:
                return True
            failed = control.recorder.state is RecorderState.FAILED
            if failed or control.program.stop_code == StopCode.RECORDER:
                return False
            time.sleep(PAUSE_S)
        return False

    def wait_for_judgement(self, periods: int) -> bool:
        """Wait until `periods` whole periods are judged, at most a minute.

        Return False if a stop ended the wait; otherwise True, even if the minute is over.
        """
        control = self._control
        until_s = time.monotonic() + JUDGE_PATIENCE_S
        while control.program.periods_judged < periods and time.monotonic() < until_s:
            if self._stopped():
                return False
            control.task.count_heartbeat()  # the program would kill a task that sends no heartbeats
            time.sleep(PAUSE_S)
        return True

    def wait_for_monitor(self, time_s: float) -> None:
        """Request temperatures for a simulated time [s], and wait for them.

        Do nothing if the monitor's period since the last request has not passed.
        """
        if not self._monitored or time_s < self._requested_s + self._least_s:
            return
        control = self._control
        self._requested_s = time_s
        requested_rounds = control.task.request_round(time_s)
        until_s = time.monotonic() + MONITOR_PATIENCE_S
        while control.monitor.rounds < requested_rounds and time.monotonic() < until_s:
            polls = control.monitor.working
            if not polls or self._stopped():
                return
            time.sleep(PAUSE_S)
