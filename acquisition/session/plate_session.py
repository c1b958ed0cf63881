"""`PlateSession`: starts, watches and ends the recording of the force plate during a motion."""

from __future__ import annotations

import os
import time
from multiprocessing.connection import wait

from acquisition.session.helper_process import HelperProcess, start_all
from acquisition.session.plate_block import PlateBlock, PlateState
from acquisition.session.plate_recorder import PlateTask, run_plate_recorder
from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from acquisition.task.states import TaskProgress
from config.cell.plate import CHANNEL_NAMES
from config.errors import RecordingError

START_PATIENCE_S = 60.0
STOP_PATIENCE_S = 30.0
WATCH_S = 0.02
OVERLOADED_PERIODS = 3


class PlateSession:
    """Plate recorder of a motion: its process is started, watched and ended here.

    Args:
        task: Plate, amplifier and file.
        samples_per_period: Number of rows per period of the motion; an overload makes a period
            unusable.

    Raises:
        RidDaqError: The plate cannot be recorded; nothing was moved.
    """

    def __init__(self, task: PlateTask, samples_per_period: int | None) -> None:
        self._block = PlateBlock.create()
        self._ranges = task.plate.amplifier.range_n
        self._samples_per_period = samples_per_period
        self._overloaded_rows = 0
        self._overloaded_periods: set[int] = set()
        self._process = HelperProcess(
            "plate recorder",
            run_plate_recorder,
            (task, self._block, os.getpid()),
            patience_s=STOP_PATIENCE_S,
        )
        start_all([self._process])
        self._wait_for_rows()

    def watch(self, progress: TaskProgress, control: ControlBlock) -> None:
        """Request a stop if the plate's connection or recorder fails, or at frequent overloads.

        Overloads are frequent if they occur in more than three periods.
        """
        status = self._block.status(time.monotonic())
        if status.state in (PlateState.LINE_LOST, PlateState.FAILED) or not self._process.is_alive:
            control.program.request_stop(StopCode.PLATE_LINE)
        if status.overloaded_rows > self._overloaded_rows and progress.sample_index >= 0:
            self._overloaded_rows = status.overloaded_rows
            self._overloaded_periods.add(
                progress.sample_index // (self._samples_per_period or 1 << 62)
            )
            if len(self._overloaded_periods) > OVERLOADED_PERIODS:
                control.program.request_stop(StopCode.PLATE_OVERLOAD)

    def close(self) -> tuple[str, ...]:
        """End the stream and the file, and return notes for the user, one sentence each."""
        self._block.request_stop()
        notes = self._process.end()
        if self._block.error is not None:
            notes = [f"force plate: {self._block.error}"]
        status = self._block.status(time.monotonic())
        if status.rows_lost:
            notes.append(
                f"force plate: {status.rows_lost} of {status.rows + status.rows_lost} rows were"
                " lost in transmission"
            )
        notes += [
            f"force plate: {name} was overloaded; its range is {range_n:g} N: choose a larger range"
            for name, range_n, over in zip(
                CHANNEL_NAMES, self._ranges, status.overloads, strict=True
            )
            if over
        ]
        return tuple(notes)

    def _wait_for_rows(self) -> None:
        """Wait until rows are being recorded; otherwise the motion must not begin."""
        until_s = time.monotonic() + START_PATIENCE_S
        while self._block.state is PlateState.STARTING:
            wait([self._process.sentinel], WATCH_S)
            if not self._process.is_alive or time.monotonic() > until_s:
                break
        if self._block.state is PlateState.RECORDING:
            return
        error, is_alive = self._block.error, self._process.is_alive
        self.close()
        what = f"has not started within {START_PATIENCE_S:g} s" if is_alive else "has ended"
        raise error or RecordingError(
            f"the plate recorder {what}; nothing was moved: close other programs, and record again",
            code="RID-SYSTEM-PROCESS-DIED",
        )
