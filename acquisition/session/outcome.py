"""`RecordOutcome`: what became of a recorded motion, by what its processes said and the journal."""

from __future__ import annotations

import signal
from dataclasses import dataclass
from pathlib import Path

from acquisition.journal.cycle_reader import CycleReader
from acquisition.journal.header import JournalHeader
from acquisition.session.helper_process import HelperProcess
from acquisition.session.timing import CycleStatistics, CycleTally
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.control_block import ControlBlock
from acquisition.task.states import TaskState
from acquisition.task.stop_orders import TEXT_OF_ORDER
from config.errors import RecordingError
from config.process.termination import Interruption

_LATE = frozenset(
    {StopCode.INTERRUPTED, StopCode.STOP_COMMAND, StopCode.STOP_BUTTON, StopCode.CLIENT_LOST}
)
"""Stops that are asked for from outside: they count also once the motion is over."""


@dataclass(frozen=True)
class RecordOutcome:
    """What became of a recorded motion; the drives are disabled and the file is closed.

    Attributes:
        path: The journal.
        stop: Why the motion did not come to its end; None where it did.
        interrupted_by: The termination signal that stopped it.
        rows: Rows in the journal.
        statistics: Timing and frames.
        notes: What else a person should know, one sentence each.
        late_stop: Why no other motion may follow this one, which came to its end: a stop was asked
            for too late for it.
        pose: Length joints. Where the joints were seen last [rad or m]; None if no cycle came.
        displaced: Whether the robot stood elsewhere than it was seen last, before the motion.
    """

    path: Path
    stop: StopReason | None
    interrupted_by: signal.Signals | None
    rows: int
    statistics: CycleStatistics
    notes: tuple[str, ...]
    late_stop: StopReason | None = None
    pose: tuple[float, ...] | None = None
    displaced: bool = False

    @property
    def complete(self) -> bool:
        """Whether the motion came to its end."""
        return self.stop is None


def outcome_of(
    path: Path,
    header: JournalHeader,
    task: HelperProcess,
    control: ControlBlock,
    interruption: Interruption,
    notes: list[str],
    pose: tuple[float, ...] | None,
) -> RecordOutcome:
    """Return what became of a motion whose processes have ended, and read back what they recorded.

    Args:
        path, header: The journal, and what it must say about itself.
        task: The cyclic task.
        control: What the processes have said.
        interruption: Says which signal came first.
        notes: What there is to say about the processes.
        pose: Where the joints were seen last [rad or m].

    Raises:
        RidDaqError: The motion failed before it began, or nothing was recorded.
    """
    notes = notes + list(control.task.notes)
    stop = control.task.stop_reason
    error = control.task.error
    finished = control.progress.state is TaskState.FINISHED
    task_exit = task.exit_code
    if stop is None and not finished:
        stop = StopReason(
            StopCode.TASK_DIED,
            f"the cyclic task died (exit code {task_exit}); the drives stop by themselves when the"
            " heartbeat ends",
        )
    elif stop is None and task_exit != 0:
        left = "left the cell without power"
        if not control.task.power_off:
            left = "ended without confirmation that power is off: make sure of it"
        stop = StopReason(
            StopCode.TASK_DIED,
            f"the cyclic task failed (exit code {task_exit}) and {left}; its traceback is on the"
            " error output: please report it",
        )
    elif stop is None and interruption.signal is not None and error is not None:
        stop = StopReason(StopCode.INTERRUPTED, f"stopped before the motion: {error}")
    elif error is not None:
        if stop is None:
            raise error
        notes.append(str(error))
    statistics = CycleTally(len(header.joint_names)).statistics()
    try:
        statistics, lost = _read_back(path, header)
        notes += lost
    except RecordingError as damage:
        if stop is None:
            raise
        notes.append(str(damage))
    return RecordOutcome(
        path=path,
        stop=stop,
        interrupted_by=interruption.signal,
        rows=statistics.cycles,
        statistics=statistics,
        notes=tuple(notes),
        late_stop=_late_stop(control, interruption) if stop is None else None,
        pose=pose,
        displaced=control.task.displaced,
    )


def _late_stop(control: ControlBlock, interruption: Interruption) -> StopReason | None:
    """Return the stop that was asked for after the task's last look, None where none was."""
    code = control.program.stop_code
    if code not in _LATE and interruption.signal is not None:
        code = StopCode.INTERRUPTED
    if code not in _LATE:
        return None
    late = StopCode(code)
    return StopReason(
        late, f"{TEXT_OF_ORDER[late]} once the motion was over; no other one is begun"
    )


def _read_back(path: Path, header: JournalHeader) -> tuple[CycleStatistics, tuple[str, ...]]:
    """Return the statistics of what was recorded, and what it has lost, one sentence each.

    Raises:
        RecordingError: It cannot be read, or is not what this motion has written.
    """
    tally = CycleTally(len(header.joint_names))
    with CycleReader(path) as reader:
        for rows in reader.rows():
            if reader.header != header:
                break
            tally.add(rows)
        if reader.header != header:
            raise RecordingError(
                f"{path}: is the recording of run {reader.header.run_id or '?'} by now: another"
                " file or folder has taken the place of this motion's",
                code="RID-RUN-REPLACED",
            )
        return tally.statistics(), reader.damage.notes
