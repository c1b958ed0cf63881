"""`EarlyStop`: applies a rule that decides, during a periodic motion, if the periods are enough."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.journal.cycle_reader import CycleReader
from acquisition.motion.samples import MotionSamples
from acquisition.recording.recording import Recording, concatenate_recordings
from acquisition.task.control_block import ControlBlock
from acquisition.task.states import TaskProgress
from config.errors import RecordingError, RidDaqError

FEWEST_PERIODS = 3
FLUSH_PATIENCE_S = 10.0
PAUSE_S = 0.02


@dataclass(frozen=True, eq=False)
class NewPeriods:
    """Periods recorded since the previous call of the rule.

    Attributes:
        recording: New rows up to the end of the last whole period, without temperatures; at the
            first call also the rows before the first period.
        folder: Folder of the run.
        first_row: Row of the motion at which the first new period begins.
        periods: Number of whole periods since the start of the motion.
    """

    recording: Recording
    folder: Path
    first_row: int
    periods: int


EarlyStopRule = Callable[[NewPeriods], bool]
"""Rule that returns True if the motion may end after the present period."""


class EarlyStop:
    """Thread that calls an early-stop rule, so that the supervision of processes is not delayed.

    Only new rows of the journal are read. Therefore the cost of a call does not depend on the
    duration of the motion. The rule is called in the order of the periods.

    Args:
        path: The journal.
        samples: The motion.
        control: Control block that passes the rule's answers to the cyclic task.
        rule: Rule that decides if the periods are enough.

    Attributes:
        pending: Latest call of the rule, which may still run.
    """

    def __init__(
        self, path: Path, samples: MotionSamples, control: ControlBlock, rule: EarlyStopRule
    ) -> None:
        self._path = path
        self._ends = {count: row for row, count in samples.period_ends.items()}
        self._rows = samples.samples_per_period or 0
        self._control = control
        self._rule = rule
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="early stop")
        self.pending: Future[None] | None = None
        self._asked = 0
        self._reader: CycleReader | None = None
        self._unseen: list[Recording] = []
        self._begun = 0  # number of periods at the previous call of the rule
        control.program.announce_judgement()

    def update(self, progress: TaskProgress) -> None:
        """Call the rule with the periods that have ended, unless a call is running.

        A period has ended when its last row was commanded.
        """
        if self._control.program.enough or (self.pending is not None and not self.pending.done()):
            return
        over = self._asked
        while over + 1 in self._ends and progress.sample_index >= self._ends[over + 1] - 1:
            over += 1
        if over > self._asked:
            self._asked = over
            self.pending = self._pool.submit(self._ask_rule, over)

    def close(self) -> None:
        """Wait for the last call of the rule and end the thread.

        Raises:
            Exception: Error of the rule; the recording is complete.
        """
        self._pool.shutdown(wait=True)
        if self._reader is not None:
            self._reader.__exit__()
        if self.pending is not None:
            self.pending.result()

    def _ask_rule(self, periods: int) -> None:
        enough = False
        try:
            # after an error, the recorder reports the state of its file, and ends the motion
            with contextlib.suppress(RecordingError):
                if periods >= FEWEST_PERIODS and self._read_until(periods):
                    enough = self._rule(self._new_periods(periods))
        finally:
            self._control.program.judge(periods, enough)

    def _new_periods(self, periods: int) -> NewPeriods:
        """Return the rows up to the end of `periods`; keep later rows for the next call."""
        rows = concatenate_recordings(self._unseen)
        later = rows.sample_index >= self._ends[periods]
        count = int(np.argmax(later)) if later.any() else len(rows)
        self._unseen = [rows.part(slice(count, None))] if count < len(rows) else []
        first_row = self._ends[self._begun + 1] - self._rows
        self._begun = periods
        return NewPeriods(rows.part(slice(0, count)), self._path.parent, first_row, periods)

    def _read_until(self, periods: int) -> bool:
        """Read the journal until it contains these periods; return False if they do not come."""
        until_s = time.monotonic() + FLUSH_PATIENCE_S
        while time.monotonic() < until_s and not self._control.task_gone:
            with contextlib.suppress(RidDaqError):  # no readable row yet
                if self._reader is None:
                    self._reader = CycleReader(self._path)
                self._unseen += self._reader.recordings(growing=True)
            last = max((int(part.sample_index.max()) for part in self._unseen), default=-1)
            if last >= self._ends[periods] - 1:
                return True
            time.sleep(PAUSE_S)
        return False
