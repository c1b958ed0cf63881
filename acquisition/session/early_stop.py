"""`PeriodJudge`: asks, while a periodic motion runs, whether its periods are enough."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from acquisition.journal.cycles import read_journal
from acquisition.motion.samples import MotionSamples
from acquisition.task.control_block import ControlBlock, Progress
from config.errors import RecordingError, RidDaqError

FEWEST_PERIODS = 3
FLUSH_PATIENCE_S = 10.0
PAUSE_S = 0.02

Enough = Callable[[Path, int], bool]
"""Whether so many whole periods in a journal are enough."""


class PeriodJudge:
    """Runs the question in a thread of its own, so that it never delays the watch of the processes.

    Parameters
    ----------
    path : Path
        The journal.
    samples : MotionSamples
        The motion.
    control : ControlBlock
        Takes the answers to the cyclic task.
    enough : callable
        The question.
    """

    def __init__(
        self, path: Path, samples: MotionSamples, control: ControlBlock, enough: Enough
    ) -> None:
        self._path = path
        self._ends = samples.period_ends
        self._control = control
        self._enough = enough
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="period judge")
        self._pending: Future[None] | None = None
        self._asked = 0
        control.judge_periods()

    def look(self, progress: Progress) -> None:
        """Ask about the periods that are over by now, unless an answer is awaited.

        A period is over when the row before its end was commanded.
        """
        if self._control.enough or (self._pending is not None and not self._pending.done()):
            return
        over = max(
            (count for row, count in self._ends.items() if progress.sample_index >= row - 1),
            default=0,
        )
        if over > self._asked:
            self._asked = over
            self._pending = self._pool.submit(self._judge, over)

    def close(self) -> None:
        """Wait for the last answer, and end the thread.

        Raises
        ------
        Exception
            What the question raised; the recording is complete by then.
        """
        self._pool.shutdown(wait=True)
        if self._pending is not None:
            self._pending.result()

    def _judge(self, periods: int) -> None:
        enough = False
        try:
            if periods >= FEWEST_PERIODS and self._written(periods):
                enough = self._enough(self._path, periods)
        except RecordingError:
            pass  # the recorder sees what becomes of its file, and ends the motion by name
        finally:
            self._control.judge(periods, enough)

    def _written(self, periods: int) -> bool:
        """Wait until the recorder has written the last row of these periods."""
        last = next(row for row, count in self._ends.items() if count == periods) - 1
        until_s = time.monotonic() + FLUSH_PATIENCE_S
        while time.monotonic() < until_s and not self._control.task_gone:
            try:
                rows = read_journal(self._path).rows
            except RidDaqError:  # nothing readable yet
                rows = None
            if rows is not None and len(rows) and int(rows["sample_index"].max()) >= last:
                return True
            time.sleep(PAUSE_S)
        return False
