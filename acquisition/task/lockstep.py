"""`Lockstep`: what simulated time stands still for, whatever the computer's speed."""

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
    """Waits, a limited time, for the processes beside the cyclic task.

    Args:
        control: Between the task and the others.
        ring: Takes a row a cycle.
        cell: Cycle time, and the drive monitor's period where it has one.
        stopped: Whether somebody has ordered a stop: then nothing is waited for.
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
        self._asked_s = -math.inf

    def wait_for_room(self) -> bool:
        """Wait until the recorder has made room in the ring; return whether it has."""
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
        """Wait until so many whole periods have been judged; return False where a stop ends it."""
        control = self._control
        until_s = time.monotonic() + JUDGE_PATIENCE_S
        while control.program.periods_judged < periods and time.monotonic() < until_s:
            if self._stopped():
                return False
            control.task.give_sign_of_life()  # a task may not be silent for so long
            time.sleep(PAUSE_S)
        return True

    def wait_for_monitor(self, time_s: float) -> None:
        """Have the drives asked for a simulated time [s], where a period of the monitor is over."""
        if not self._monitored or time_s < self._asked_s + self._least_s:
            return
        control = self._control
        self._asked_s = time_s
        asked = control.task.ask_round(time_s)
        until_s = time.monotonic() + MONITOR_PATIENCE_S
        while control.monitor.rounds < asked and time.monotonic() < until_s:
            polls = control.monitor.working
            if not polls or self._stopped():
                return
            time.sleep(PAUSE_S)
