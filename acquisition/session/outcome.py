"""`RecordOutcome`: outcome of a recorded motion, from its processes' reports and the journal."""

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
"""Stops that a user or client requests; these also apply after the end of the motion."""


@dataclass(frozen=True)
class RecordOutcome:
    """Outcome of a recorded motion, after its processes have ended.

    Attributes:
        path: The journal.
        stop: Reason for which the motion was stopped before its end; None if it was complete.
        interrupted_by: First termination signal, even if something else stopped the motion; None
            without a signal.
        rows: Number of rows in the journal.
        statistics: Statistics of timing and frames.
        notes: Other notes for the user, one sentence each.
        late_stop: Stop that was requested after the end of this complete motion: no other motion
            may follow.
        pose: Last known position of each joint [rad or m]; None if there was no cycle.
        displaced: True if the robot was not at its last known pose before the motion.
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
        """True if the motion reached its end."""
        return self.stop is None


def collect_outcome(
    path: Path,
    header: JournalHeader,
    task: HelperProcess,
    control: ControlBlock,
    interruption: Interruption,
    notes: list[str],
    pose: tuple[float, ...] | None,
) -> RecordOutcome:
    """Return the outcome of a motion whose processes have ended, and read its journal.

    Args:
        path, header: The journal, and its expected header.
        task: Process of the cyclic task, which has ended.
        control: Reports of the processes.
        interruption: First termination signal, if any.
        notes: Notes about the processes.
        pose: Last known joint positions [rad or m].

    Raises:
        RidDaqError: The motion failed before it began, nothing was recorded, or the journal cannot
            be read or was replaced.
    """
    notes = notes + list(control.task.notes)
    stop = control.task.stop_reason
    error = control.task.error
    finished = control.progress.state is TaskState.FINISHED
    task_exit = task.exit_code
    if stop is None and not finished:
        stop = StopReason(StopCode.TASK_DIED, task.death)
    elif stop is None and task_exit != 0:
        ending = "disabled the drives"
        if not control.task.power_off:
            ending = (
                "ended without confirmation that the drives are disabled: check them before"
                " going near the robot"
            )
        stop = StopReason(
            StopCode.TASK_DIED,
            f"the cyclic task failed (exit code {task_exit}) and {ending}; its traceback is in the"
            " error output: please report it",
        )
    elif stop is None and interruption.signal is not None and error is not None:
        stop = StopReason(StopCode.INTERRUPTED, f"stopped before the motion: {error}")
    elif error is not None:
        if stop is None:
            raise error
        notes.append(str(error))
    if stop is not None and not finished and stop.code is not StopCode.TASK_DIED:
        notes.append(f"during the stop, {task.death}")
    statistics = CycleTally(len(header.joint_names)).statistics()
    try:
        statistics, lost = _read_journal(path, header)
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
        late_stop=_find_late_stop(control, interruption) if stop is None else None,
        pose=pose,
        displaced=control.task.displaced,
    )


def _find_late_stop(control: ControlBlock, interruption: Interruption) -> StopReason | None:
    """Return a stop that was requested too late to stop the motion; None without such a stop."""
    code = control.program.stop_code
    if code not in _LATE and interruption.signal is not None:
        code = StopCode.INTERRUPTED
    if code not in _LATE:
        return None
    late = StopCode(code)
    return StopReason(
        late, f"{TEXT_OF_ORDER[late]} after the end of the motion; no other motion is started"
    )


def _read_journal(path: Path, header: JournalHeader) -> tuple[CycleStatistics, tuple[str, ...]]:
    """Return the statistics of the journal and its losses, one sentence each.

    Raises:
        RecordingError: The journal cannot be read, or is not that of this motion.
    """
    tally = CycleTally(len(header.joint_names))
    with CycleReader(path) as reader:
        for rows in reader.rows():
            if reader.header != header:
                break
            tally.add(rows)
        if reader.header != header:
            raise RecordingError(
                f"{path}: is now the recording of run {reader.header.run_id or '?'}: another file"
                " or folder has replaced the recording of this motion",
                code="RID-RUN-REPLACED",
            )
        return tally.statistics(), reader.damage.notes
