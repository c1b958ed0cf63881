"""The recorder: a process that copies rows from the ring to the journal.

It outlives the cyclic task and the program: if the program is killed, no row in the ring is lost.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

from acquisition.journal.cycles import JournalWriter
from acquisition.journal.header import JournalHeader
from acquisition.journal.mcap_writer import FLUSH_PERIOD_S, SYNC_PERIOD_S
from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from acquisition.task.states import RecorderState
from config.errors import RecordingError
from config.process.own_process import ProcessName, set_process_name
from config.process.shortage import named_error
from config.process.termination import leave_terminal

IDLE_S = 0.01
ORPHAN_PATIENCE_S = 5.0


def run_recorder(
    ring: Ring, control: ControlBlock, path: Path, header: JournalHeader, parent: int
) -> None:
    """Run the recorder; main function of its process.

    It ends once the task has ended and the ring is empty. After the program's death it also ends if
    the task has had no heartbeat for `ORPHAN_PATIENCE_S`.

    Args:
        ring: Source of the rows.
        control: Shared state of the motion's processes; the recorder reports its state there and
            reads that the task has ended.
        path: Journal to write.
        header: Header of the journal.
        parent: Process id of the program.
    """
    leave_terminal()
    set_process_name(ProcessName.RECORDER)
    try:
        with JournalWriter(path, header) as writer:
            control.recorder.state = RecorderState.RECORDING
            _copy_rows(ring, control, writer, parent)
        control.recorder.state = RecorderState.FINISHED
    except Exception as error:
        control.recorder.fail(named_error(error))


def _copy_rows(ring: Ring, control: ControlBlock, writer: JournalWriter, parent: int) -> None:
    flushed = synced = alive = time.monotonic()
    beat = -1
    while True:
        # read this flag before the rows: then no row that the task wrote before its end is missed
        last = control.task_gone
        rows = ring.read()
        if rows:
            writer.append(rows)
        elif last:
            return
        now = time.monotonic()
        if now - flushed >= FLUSH_PERIOD_S:
            to_disk = now - synced >= SYNC_PERIOD_S
            writer.flush(to_disk=to_disk)
            flushed = now
            synced = now if to_disk else synced
            trouble = writer.trouble
            if trouble and control.recorder.state is RecorderState.RECORDING:
                control.recorder.end(
                    RecordingError(f"{writer.path}: {trouble}", code="RID-RECORDING-LOST")
                )
        if writer.disk_full and control.recorder.state is RecorderState.RECORDING:
            control.recorder.end(
                RecordingError(f"{writer.path}: the disk is full", code="RID-SYSTEM-DISK-FULL")
            )
        if os.getppid() != parent:
            if control.task.beat != beat:
                beat, alive = control.task.beat, now
            elif now - alive > ORPHAN_PATIENCE_S:
                return
        if not rows:
            time.sleep(IDLE_S)
