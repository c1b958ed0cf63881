"""`record_motion`: move the robot and record it, by one process for the loop, one for the disk."""

from __future__ import annotations

import os
import shutil
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing import get_context
from multiprocessing.connection import wait
from multiprocessing.context import SpawnProcess
from pathlib import Path

from acquisition.journal.cycle_reader import CycleReader
from acquisition.journal.header import JournalHeader
from acquisition.journal.plate import PLATE_RECORDING
from acquisition.motion.collision import refuse_collision
from acquisition.motion.limits import verify_limits
from acquisition.motion.samples import MotionSamples
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RECORDING
from acquisition.session.cycle_recorder import run_recorder
from acquisition.session.early_stop import EarlyStop, EarlyStopRule
from acquisition.session.plate_preparation import prepare_plate
from acquisition.session.plate_recorder import PlateTask
from acquisition.session.plate_session import PlateSession
from acquisition.session.processes import (
    Onlooker,
    end_monitor,
    end_onlooker,
    monitor_process,
    start_processes,
)
from acquisition.session.timing import CycleStatistics, CycleTally
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.control_block import (
    ControlBlock,
    Progress,
    RecorderState,
    TaskState,
)
from acquisition.task.joint_values import JointWatch
from acquisition.task.process import run_cyclic_task
from acquisition.task.ring import Ring
from acquisition.task.set_points import PlannedMotion, SetPointSource
from config.cell.amplifier_profile import AmplifierProfile
from config.cell.cell import CellConfig
from config.cell.drive_profile import DriveProfile
from config.errors import ConfigError, PreflightError, RecordingError
from config.process.termination import (
    Interruption,
    suspension_refused,
    termination_calls,
)
from config.robot.robot import RobotDescription
from dynamics.geometry.clearances import Clearances

RING_S = 10.0
RING_ROWS = 4096
FREE_BYTES = 500 << 20
FREE_FACTOR = 3
WATCH_S = 0.05
START_PATIENCE_S = 60.0
BEAT_PATIENCE_S = 10.0
STOP_PATIENCE_S = 15.0
FINISH_PATIENCE_S = 30.0
NO_PAUSE = "Ctrl-Z does not pause a robot: the motion goes on. Ctrl-C stops it."


@dataclass(frozen=True)
class RecordOutcome:
    """What became of a recorded motion; the drives are disabled and the file is closed.

    Attributes
    ----------
    path : Path
        The journal.
    stop : StopReason or None
        Why the motion did not come to its end; None where it did.
    interrupted_by : Signals or None
        The termination signal that stopped it.
    rows : int
        Rows in the journal.
    statistics : CycleStatistics
        Timing and frames.
    notes : tuple of str
        What else a person should know, one sentence each.
    """

    path: Path
    stop: StopReason | None
    interrupted_by: signal.Signals | None
    rows: int
    statistics: CycleStatistics
    notes: tuple[str, ...]

    @property
    def complete(self) -> bool:
        """Whether the motion came to its end."""
        return self.stop is None


def record_motion(
    cell: CellConfig,
    robot: RobotDescription,
    motion: MotionSamples | SetPointSource,
    folder: RunFolder,
    *,
    on_progress: Callable[[Progress], None] | None = None,
    enough: EarlyStopRule | None = None,
    profile: AmplifierProfile | None = None,
    drive_profile: DriveProfile | None = None,
    onlooker: Onlooker | None = None,
) -> RecordOutcome:
    """Approach the motion, stream it, record it into the run folder, stop and disable.

    Ctrl-C, SIGTERM and SIGHUP stop the motion (quick stop) and are reported in the outcome, however
    often they come; the clean-up always completes, and once one came this process ignores further
    ones, so that what was recorded can be written down. Every wait is limited. Ctrl-Z is answered
    with a sentence: the processes of a motion stand apart from the terminal, and this one, which
    watches them, goes on too.

    Parameters
    ----------
    cell, robot : CellConfig, RobotDescription
        The cell and its robot.
    motion : MotionSamples or SetPointSource
        The motion, sampled at the cell's cycle time and checked here; or a source that checks
        what it hands out.
    folder : RunFolder
        Where `recording.mcap` is written; its manifest is left to the caller.
    on_progress : callable, optional
        Called about 20 times a second.
    enough : callable, optional
        Asked about every new period, in a thread of its own; where it returns True the motion goes
        over to its run-out after the period under way.
    profile : AmplifierProfile, optional
        What the cell's amplifier speaks: the force plate is recorded beside, into `plate.mcap`.
    drive_profile : DriveProfile, optional
        The registers of the drives, where the cell has a monitor; the bundled one of the cell's
        name when left out. Temperatures go to `monitor.mcap`; without them the motion is recorded
        all the same, and a note says so.
    onlooker : callable, optional
        Makes one more process, such as the live page's. It is not waited for, and its death changes
        nothing.

    Raises
    ------
    PreflightError
        The motion does not fit the cell's limits, or a drive's settings are red; nothing moved.
    DriverError
        Bus or drives failed before the motion.
    RecordingError
        There is no room to record, or nothing was recorded.
    """
    source: SetPointSource
    planned: MotionSamples | None = None
    if isinstance(motion, MotionSamples):
        _check_motion(cell, robot, motion)
        source, planned = PlannedMotion(motion), motion
    else:
        source = motion
    path = folder.file(RECORDING)
    ring = Ring.create(len(robot.joints), max(RING_ROWS, int(RING_S / cell.cycle_time_s)))
    _check_room(folder.path, source.rows_expected * (ring.row_size + 64))
    control = ControlBlock.create()
    early_stop = None
    if enough is not None and planned is not None:
        early_stop = EarlyStop(path, planned, control, enough)
    header = JournalHeader(
        joint_names=robot.joint_names,
        sample_period_s=cell.cycle_time_s,
        samples_per_period=source.samples_per_period,
        torque_filter=cell.torque_filter,
        cell_name=cell.name,
        robot_name=robot.name,
        run_id=folder.run_id,
    )
    spawn = get_context("spawn")
    task = spawn.Process(
        target=run_cyclic_task,
        args=(cell, robot, source, ring, control, os.getpid()),
        name="rid-daq cyclic task",
    )
    recorder = spawn.Process(
        target=run_recorder,
        args=(ring, control, path, header, os.getpid()),
        name="rid-daq recorder",
    )
    processes = [recorder, task]
    monitor = monitor_process(cell, robot, drive_profile, control, folder)
    if monitor is not None:
        processes.insert(0, monitor)
    looker = None if onlooker is None else onlooker(ring, control)
    if looker is not None:
        processes.insert(0, looker)
    joints = JointWatch(ring, cell, robot)
    with (
        suspension_refused(NO_PAUSE),
        termination_calls(
            lambda: control.request_stop(StopCode.INTERRUPTED), then_ignored=True
        ) as interruption,
    ):
        plate = _start_plate(cell, source, folder, profile)
        notes: list[str] = []
        try:
            start_processes(processes)
            try:
                _watch(task, recorder, monitor, control, joints, on_progress, early_stop, plate)
            finally:
                notes += _wind_up(task, recorder, control)
                notes += end_monitor(monitor, control)
                notes += end_onlooker(looker)
                if early_stop is not None:
                    early_stop.close()
        finally:
            if plate is not None:
                notes += plate.close()
    return _outcome(path, header, task, recorder, control, interruption, notes)


def _check_motion(cell: CellConfig, robot: RobotDescription, samples: MotionSamples) -> None:
    if samples.sample_period_s != cell.cycle_time_s:
        raise ConfigError(
            f"the motion is sampled every {samples.sample_period_s * 1e3:g} ms, the cell's cycle"
            f" takes {cell.cycle_time_ms} ms: plan the motion for this cell"
        )
    try:
        verify_limits(samples, robot)
    except ConfigError as error:
        raise PreflightError(f"{error}; nothing was moved") from error
    clearances = Clearances.of(robot, cell.workspace)
    refuse_collision(clearances, samples.position, samples.sample_period_s, "the motion")


def _start_plate(
    cell: CellConfig, source: SetPointSource, folder: RunFolder, profile: AmplifierProfile | None
) -> PlateSession | None:
    """Make the force plate ready and begin to record it, where the cell has one.

    Raises
    ------
    PreflightError
        It is not zeroed.
    DriverError
        It cannot be reached.
    """
    if cell.plate is None or profile is None:
        return None
    ready = prepare_plate(cell.plate, profile, operate=cell.simulated)
    if ready.charge_lost or not ready.operating:
        lost = "has been set as the cell file says, which lost its charge"
        what = lost if ready.charge_lost else "is in reset and measures nothing"
        raise PreflightError(
            f"force plate: the amplifier {what}: zero the plate (`rid-daq plate zero`); nothing was"
            " moved"
        )
    task = PlateTask(cell.plate, profile, folder.file(PLATE_RECORDING), cell.name, folder.run_id)
    return PlateSession(task, source.samples_per_period)


def _check_room(folder: Path, expected_bytes: int) -> None:
    needed = FREE_FACTOR * expected_bytes + FREE_BYTES
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise RecordingError(
            f"{folder}: {free >> 20} MB are free, {needed >> 20} MB are needed to record this"
            " motion safely; make room or choose another folder"
        )


def _watch(
    task: SpawnProcess,
    recorder: SpawnProcess,
    monitor: SpawnProcess | None,
    control: ControlBlock,
    joints: JointWatch,
    on_progress: Callable[[Progress], None] | None,
    early_stop: EarlyStop | None,
    plate: PlateSession | None,
) -> None:
    """Wait for the task to end; tell it when the recorder dies, kill it when it hangs."""
    beat, changed_s = -1, time.monotonic()
    sentinels = [task.sentinel, recorder.sentinel]
    while task.is_alive():
        wait(sentinels, WATCH_S)
        if len(sentinels) == 2 and not recorder.is_alive():
            sentinels.pop()
            control.request_stop(StopCode.RECORDER)
        if monitor is not None and not monitor.is_alive():
            control.declare_monitor_dead()
        progress = control.progress
        now_s = time.monotonic()
        if control.task_beat != beat:
            beat, changed_s = control.task_beat, now_s
        moving = progress.state in (TaskState.MOVING, TaskState.STOPPING)
        if now_s - changed_s > (BEAT_PATIENCE_S if moving else START_PATIENCE_S):
            task.kill()
            task.join()
        if early_stop is not None:
            early_stop.look(progress)
        if plate is not None:
            plate.watch(progress, control)
        if on_progress is not None:
            on_progress(replace(progress, joints=joints.look()))


def _wind_up(task: SpawnProcess, recorder: SpawnProcess, control: ControlBlock) -> list[str]:
    """End both processes, in whatever state they are; return what had to be done by force."""
    notes = []
    if task.is_alive():
        control.request_stop(StopCode.INTERRUPTED)
        task.join(STOP_PATIENCE_S)
    if task.is_alive():
        notes.append("the cyclic task did not stop when asked and was killed")
        task.kill()
        task.join()
    control.declare_task_gone()
    recorder.join(FINISH_PATIENCE_S)
    if recorder.is_alive():
        notes.append("the recorder did not finish and was killed; its file is not closed")
        recorder.kill()
        recorder.join()
    return notes


def _outcome(
    path: Path,
    header: JournalHeader,
    task: SpawnProcess,
    recorder: SpawnProcess,
    control: ControlBlock,
    interruption: Interruption,
    notes: list[str],
) -> RecordOutcome:
    notes += control.notes
    stop = control.stop_reason
    error = control.task_error
    finished = control.progress.state is TaskState.FINISHED
    task_exit, recorder_exit = task.exitcode, recorder.exitcode
    task.close()
    recorder.close()
    if stop is None and not finished:
        stop = StopReason(
            StopCode.TASK_DIED,
            f"the cyclic task died (exit code {task_exit}); the drives stop by themselves when the"
            " heartbeat ends",
        )
    elif stop is None and task_exit != 0:
        stop = StopReason(
            StopCode.TASK_DIED,
            f"the cyclic task failed (exit code {task_exit}) and left the cell disabled; its"
            " traceback is on the error output: please report it",
        )
    elif stop is None and interruption.signal is not None and error is not None:
        stop = StopReason(StopCode.INTERRUPTED, f"stopped before the motion: {error}")
    elif error is not None:
        if stop is None:
            raise error
        notes.append(str(error))
    if control.recorder_state is RecorderState.FAILED:
        notes.append(control.recorder_error)
    elif control.recorder_state is not RecorderState.FINISHED:
        notes.append(f"the recorder died (exit code {recorder_exit}); its file is not closed")
    tally = CycleTally(len(header.joint_names))
    try:
        notes += _read_back(path, header, tally)
    except RecordingError as damage:
        if stop is None:
            raise
        notes.append(str(damage))
    statistics = tally.statistics()
    return RecordOutcome(
        path=path,
        stop=stop,
        interrupted_by=interruption.signal,
        rows=statistics.cycles,
        statistics=statistics,
        notes=tuple(notes),
    )


def _read_back(path: Path, header: JournalHeader, tally: CycleTally) -> tuple[str, ...]:
    """Count what was recorded; return what it has lost, one sentence each.

    Raises
    ------
    RecordingError
        It cannot be read, or is not what this motion has written.
    """
    with CycleReader(path) as reader:
        for rows in reader.rows():
            if reader.header != header:
                break
            tally.add(rows)
        if reader.header != header:
            raise RecordingError(
                f"{path}: is the recording of run {reader.header.run_id or '?'} by now: another"
                " file or folder has taken the place of this motion's"
            )
        return reader.damage.notes
