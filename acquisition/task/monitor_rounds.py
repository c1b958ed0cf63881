"""`MonitorRounds`: in lock-step, simulated time stands still while the drives are asked."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from acquisition.task.control_block import ControlBlock, MonitorState

MONITOR_PATIENCE_S = 20.0
PAUSE_S = 0.001


class MonitorRounds:
    """Asks the monitor for a round once a period of its own, and waits for it.

    Parameters
    ----------
    control : ControlBlock
        Between the cyclic task and the monitor.
    period_s, cycle_time_s : float
        Of the monitor and of the task [s].
    """

    def __init__(self, control: ControlBlock, period_s: float, cycle_time_s: float) -> None:
        self._control = control
        self._least_s = period_s - 0.5 * cycle_time_s
        self._asked_s = -math.inf

    def ask_when_due(self, time_s: float, ended: Callable[[], bool]) -> None:
        """Have a round made for a simulated time [s] where it is due; `ended` ends the wait."""
        if time_s < self._asked_s + self._least_s:
            return
        self._asked_s = time_s
        asked = self._control.ask_monitor(time_s)
        until_s = time.monotonic() + MONITOR_PATIENCE_S
        while self._control.monitor_rounds < asked and time.monotonic() < until_s:
            state = self._control.monitor_state
            if state not in (MonitorState.STARTING, MonitorState.POLLING) or ended():
                return
            time.sleep(PAUSE_S)
