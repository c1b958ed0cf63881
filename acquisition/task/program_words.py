"""`ProgramWords`: what the program tells the processes of a motion."""

from __future__ import annotations

import ctypes

from acquisition.supervision.stop_reason import StopCode


class ProgramWords(ctypes.Structure):
    """Written by the program; a request to stop also by the live page and by `rid-daq stop`."""

    _stop_code: int

    _fields_ = (
        ("_stop_code", ctypes.c_int64),
        ("_task_gone", ctypes.c_int64),
        ("_judging", ctypes.c_int64),
        ("_periods_judged", ctypes.c_int64),
        ("_enough", ctypes.c_int64),
        ("_monitored", ctypes.c_int64),
    )

    def request_stop(self, code: StopCode) -> None:
        """Ask the task to stop; the first request counts. Safe in a signal handler."""
        if not self._stop_code:
            self._stop_code = int(code)

    @property
    def stop_code(self) -> int:
        """`StopCode` of the request to stop, 0 where there is none."""
        return int(self._stop_code)

    def declare_task_gone(self) -> None:
        """Tell the recorder that no more rows will come."""
        self._task_gone = 1

    @property
    def task_gone(self) -> bool:
        """Whether the program has seen that the task has ended."""
        return bool(self._task_gone)

    def judge_periods(self) -> None:
        """Announce, before the motion, that each period will be judged (`judge`)."""
        self._judging = 1

    @property
    def judging(self) -> bool:
        """Whether the program judges each period."""
        return bool(self._judging)

    def judge(self, periods: int, enough: bool) -> None:
        """Say that so many periods have been judged, and whether they are enough."""
        self._enough = int(enough)
        self._periods_judged = periods

    @property
    def periods_judged(self) -> int:
        """How many periods have been judged."""
        return int(self._periods_judged)

    @property
    def enough(self) -> bool:
        """Whether those are enough."""
        return bool(self._enough)

    def announce_monitor(self, joints: int) -> None:
        """Say, before the motion, that the drives of so many joints are asked for temperatures."""
        self._monitored = joints

    @property
    def monitored(self) -> int:
        """Of how many joints the drives are asked for temperatures; 0: of none."""
        return int(self._monitored)
