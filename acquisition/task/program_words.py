"""`ProgramWords`: shared memory that the program writes for the processes of a motion."""

from __future__ import annotations

import ctypes

from acquisition.supervision.stop_reason import StopCode


class ProgramWords(ctypes.Structure):
    """Fields that the program writes; live page and `rid-daq stop` also write stop requests."""

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
        """Request a stop of the task; the first request counts. Safe in a signal handler."""
        if not self._stop_code:
            self._stop_code = int(code)

    @property
    def stop_code(self) -> int:
        """`StopCode` of the stop request; 0 without a request."""
        return int(self._stop_code)

    def declare_task_gone(self) -> None:
        """Report to the recorder that no more rows will come."""
        self._task_gone = 1

    @property
    def task_gone(self) -> bool:
        """True if the program has detected the end of the task."""
        return bool(self._task_gone)

    def announce_judgement(self) -> None:
        """Announce, before the motion, that each period will be judged (`judge`)."""
        self._judging = 1

    @property
    def judging(self) -> bool:
        """True if the program judges each period."""
        return bool(self._judging)

    def judge(self, periods: int, enough: bool) -> None:
        """Report to the cyclic task the number of periods that the early-stop rule has judged.

        With `enough`, the motion ends after the present period.
        """
        self._enough = int(enough)
        self._periods_judged = periods

    @property
    def periods_judged(self) -> int:
        """Number of periods that the early-stop rule has judged."""
        return int(self._periods_judged)

    @property
    def enough(self) -> bool:
        """True if the judged periods are enough."""
        return bool(self._enough)

    def announce_monitor(self, joints: int) -> None:
        """Announce, before the motion, the number of joints whose temperatures are read."""
        self._monitored = joints

    @property
    def monitored(self) -> int:
        """Number of joints whose drive temperatures are read; 0 without a monitor."""
        return int(self._monitored)
