"""`record_motion`: moves the robot and records it; starts and watches the processes of both."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing.connection import wait
from pathlib import Path

from acquisition.journal.disk_reserve import FREE_BYTES
from acquisition.journal.header import JournalHeader
from acquisition.journal.plate import PLATE_RECORDING
from acquisition.motion.collision import refuse_collision
from acquisition.motion.known_pose import KnownPose
from acquisition.motion.limits import verify_limits
from acquisition.motion.samples import MotionSamples
from acquisition.motion.stop_distance import verify_stops
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RECORDING
from acquisition.session.cycle_recorder import run_recorder
from acquisition.session.drive_monitor import create_monitor_process, end_monitor, mark_monitor_dead
from acquisition.session.early_stop import EarlyStop, EarlyStopRule
from acquisition.session.helper_process import (
    HelperProcess,
    Observer,
    ProcessFactory,
    start_all,
)
from acquisition.session.outcome import RecordOutcome, collect_outcome
from acquisition.session.plate_preparation import prepare_plate
from acquisition.session.plate_recorder import PlateTask
from acquisition.session.plate_session import PlateSession
from acquisition.supervision.commanded import verify_command
from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from acquisition.task.joint_values import JointWatch
from acquisition.task.marked_start import MarkedStart, StartMarker
from acquisition.task.process import MotionOwner, drive_motion, run_cyclic_task
from acquisition.task.ring import Ring
from acquisition.task.service_beat import ServiceBeat
from acquisition.task.set_points import PlannedMotion, SetPointSource
from acquisition.task.states import RecorderState, TaskProgress, TaskState
from config.cell.amplifier_profile import AmplifierProfile
from config.cell.cell import CellConfig
from config.cell.drive_profile import DriveProfile
from config.errors import ConfigError, PreflightError, RecordingError
from config.process.termination import signals_handled, suspension_refused
from config.robot.robot import RobotDescription
from drivers.settings.write_log import DRIVE_WRITES
from dynamics.geometry.clearances import Clearances

RING_S = 10.0
RING_ROWS = 4096
FREE_FACTOR = 3
WATCH_S = 0.05
START_PATIENCE_S = 60.0
BEAT_PATIENCE_S = 10.0
STOP_PATIENCE_S = 15.0
FINISH_PATIENCE_S = 30.0
DRIVES_STOP = "the drives stop by themselves when the heartbeat ends"
SIMULATION_ENDED = (
    "the simulated drives were in the same process and ended with it, so they did not report that"
    " they are disabled: run the command again to start them anew"
)
NO_PAUSE = "Ctrl-Z cannot suspend a motion: the motion continues. Ctrl-C stops it."


@dataclass(frozen=True)
class DeviceProfiles:
    """Protocols of the devices other than the drives on the bus.

    Attributes:
        amplifier: Protocol of the force plate's amplifier. The plate is recorded in `plate.mcap`;
            if None, it is not recorded.
        drives: Registers of the drives, if the cell has a monitor; default: the bundled profile
            named in the cell. Temperatures are written to `monitor.mcap`. Without temperatures the
            motion is recorded all the same, with a note.
    """

    amplifier: AmplifierProfile | None = None
    drives: DriveProfile | None = None


@dataclass(frozen=True)
class MotionContext:
    """Optional circumstances of a motion.

    Attributes:
        observer: Creates one more process, such as that of the live page. Its death does not affect
            the motion.
        service: Heartbeat of the service that ordered the motion: without it the motion stops.
        pose: Last known pose of the robot; it is checked before the drives are enabled.
        task: Creates the cyclic task in the process of a simulated cell; None for a new process.
        marker: Receiver of the motion's first row, such as a simulation; None without one.
    """

    observer: Observer | None = None
    service: ServiceBeat | None = None
    pose: KnownPose | None = None
    task: ProcessFactory | None = None
    marker: StartMarker | None = None


def record_motion(
    cell: CellConfig,
    robot: RobotDescription,
    motion: MotionSamples | SetPointSource,
    folder: RunFolder,
    *,
    on_progress: Callable[[TaskProgress], None] | None = None,
    enough: EarlyStopRule | None = None,
    profiles: DeviceProfiles | None = None,
    context: MotionContext | None = None,
) -> RecordOutcome:
    """Approach the motion's start, drive and record the motion, then stop and disable the drives.

    - Ctrl-C, SIGTERM and SIGHUP stop the motion (quick stop), however often they come, and are
      reported in the outcome. After the first signal this process ignores further ones, so that it
      can save the recording.
    - The clean-up always completes, and every wait for a process has a timeout.
    - Ctrl-Z only prints a sentence. The processes of a motion are independent of the terminal, and
      this process, which watches them, is not suspended either.

    Args:
        cell, robot: The cell and its robot.
        motion: The motion, sampled at the cell's cycle time and checked here; or a source that
            checks its own set-points.
        folder: Run folder for `recording.mcap`; the caller updates its manifest.
        on_progress: Function that is called with the progress, about 20 times a second.
        enough: Rule that is asked about new periods, from the third on, in its own thread; if it
            returns True, the motion proceeds to its run-out after the present period. It is not
            used with a source of set-points.
        profiles: Protocols of amplifier and drive registers.
        context: Optional circumstances of the motion.

    Raises:
        ConfigError: The motion was sampled for another cycle time.
        PreflightError: The motion exceeds the cell's limits, or a drive has a wrong setting;
            nothing was moved.
        DriverError: Bus or drives failed before the motion.
        RecordingError: There is not enough disk space, or nothing was recorded.
        ShortageError: The computer cannot start another process.
    """
    source: SetPointSource
    planned: MotionSamples | None = None
    if isinstance(motion, MotionSamples):
        _check_motion(cell, robot, motion)
        source, planned = PlannedMotion(motion), motion
    else:
        source = motion
    profiles = profiles or DeviceProfiles()
    context = context or MotionContext()
    if context.marker is not None:
        source = MarkedStart(source, context.marker)
    path = folder.file(RECORDING)
    ring = Ring.create(len(robot.joints), max(RING_ROWS, int(RING_S / cell.cycle_time_s)))
    _require_disk_space(folder.path, source.rows_expected * (ring.row_size + 64))
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
    task = HelperProcess(
        "cyclic task",
        run_cyclic_task if context.task is None else drive_motion,
        (
            cell,
            robot,
            source,
            ring,
            control,
            folder.file(DRIVE_WRITES),
            MotionOwner(os.getpid(), context.service),
            context.pose,
        ),
        patience_s=STOP_PATIENCE_S,
        loss=DRIVES_STOP if context.task is None else SIMULATION_ENDED,
        create=context.task,
    )
    recorder = HelperProcess(
        "recorder",
        run_recorder,
        (ring, control, path, header, os.getpid()),
        patience_s=FINISH_PATIENCE_S,
    )
    monitor = create_monitor_process(cell, robot, profiles.drives, control, folder)
    watcher = None if context.observer is None else context.observer(ring, control)
    joints = JointWatch(ring, cell, robot)
    with (
        suspension_refused(NO_PAUSE),
        signals_handled(
            lambda: control.program.request_stop(StopCode.INTERRUPTED), then_ignored=True
        ) as interruption,
    ):
        plate = _start_plate(cell, source, folder, profiles.amplifier)
        notes: list[str] = []
        try:
            start_all([each for each in (watcher, monitor, recorder, task) if each is not None])
            try:
                _watch_processes(
                    task, recorder, monitor, control, joints, on_progress, early_stop, plate
                )
            finally:
                notes += _end_processes(task, recorder, control)
                if monitor is not None:
                    notes += end_monitor(monitor, control)
                if watcher is not None:
                    notes += watcher.end()
                if early_stop is not None:
                    early_stop.close()
        finally:
            if plate is not None:
                notes += plate.close()
    latest = joints.look()
    pose = None if latest is None else tuple(latest.position.tolist())
    return collect_outcome(path, header, task, control, interruption, notes, pose)


def _check_motion(cell: CellConfig, robot: RobotDescription, samples: MotionSamples) -> None:
    if samples.sample_period_s != cell.cycle_time_s:
        raise ConfigError(
            f"the motion is sampled every {samples.sample_period_s * 1e3:g} ms, but the cell's"
            f" cycle time is {cell.cycle_time_ms} ms: plan the motion for this cell",
            code="RID-MOTION-CYCLE",
        )
    try:
        verify_limits(samples, robot)
        verify_command(samples, cell, robot)
    except ConfigError as error:
        raise PreflightError(f"{error}; nothing was moved", code=error.refusal) from error
    clearances = Clearances.of(robot, cell.workspace)
    refuse_collision(clearances, samples.position, samples.sample_period_s, "the motion")
    verify_stops(samples, cell, robot, clearances)


def _start_plate(
    cell: CellConfig, source: SetPointSource, folder: RunFolder, profile: AmplifierProfile | None
) -> PlateSession | None:
    """Prepare the force plate and start its recording; return None without a plate.

    Raises:
        PreflightError: The plate is not zeroed.
        DriverError: The amplifier cannot be reached.
    """
    if cell.plate is None or profile is None:
        return None
    ready = prepare_plate(cell.plate, profile, operate=cell.simulated)
    if ready.charge_lost or not ready.operating:
        lost = "was configured according to the cell file, which discharged its channels"
        what = lost if ready.charge_lost else "is in reset and does not measure"
        raise PreflightError(
            f"force plate: the amplifier {what}: zero the plate (`rid-daq plate zero`); nothing"
            " has moved",
            code="RID-PLATE-NOT-ZEROED",
        )
    task = PlateTask(cell.plate, profile, folder.file(PLATE_RECORDING), cell.name, folder.run_id)
    return PlateSession(task, source.samples_per_period)


def _require_disk_space(folder: Path, expected_bytes: int) -> None:
    needed = FREE_FACTOR * expected_bytes + FREE_BYTES
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise RecordingError(
            f"{folder}: {free >> 20} MB are free, but {needed >> 20} MB are needed to record this"
            " motion: free disk space or choose another folder",
            code="RID-SYSTEM-DISK-FULL",
        )


def _watch_processes(
    task: HelperProcess,
    recorder: HelperProcess,
    monitor: HelperProcess | None,
    control: ControlBlock,
    joints: JointWatch,
    on_progress: Callable[[TaskProgress], None] | None,
    early_stop: EarlyStop | None,
    plate: PlateSession | None,
) -> None:
    """Wait for the end of the task. Request a stop if the recorder dies; kill a task that hangs."""
    beat, changed_s = -1, time.monotonic()
    sentinels = [task.sentinel, recorder.sentinel]
    while task.is_alive:
        wait(sentinels, WATCH_S)
        if len(sentinels) == 2 and not recorder.is_alive:
            sentinels.pop()
            control.program.request_stop(StopCode.RECORDER)
        if monitor is not None and not monitor.is_alive:
            mark_monitor_dead(control)
        progress = control.progress
        now_s = time.monotonic()
        if control.task.beat != beat:
            beat, changed_s = control.task.beat, now_s
        moving = progress.state in (TaskState.MOVING, TaskState.STOPPING)
        patience_s = BEAT_PATIENCE_S if moving else START_PATIENCE_S
        if now_s - changed_s > patience_s:
            task.kill_hung(patience_s)
        if early_stop is not None:
            early_stop.update(progress)
        if plate is not None:
            plate.watch(progress, control)
        if on_progress is not None:
            on_progress(replace(progress, joints=joints.look()))


def _end_processes(
    task: HelperProcess, recorder: HelperProcess, control: ControlBlock
) -> list[str]:
    """End task and recorder in any state, and return notes about them.

    `collect_outcome` reports the death of the task.
    """
    notes = []
    if task.is_alive:
        control.program.request_stop(StopCode.INTERRUPTED)
        if not task.wait(STOP_PATIENCE_S):
            notes.append("the cyclic task did not stop on request and was killed")
            task.kill()
    task.end()
    control.program.declare_task_gone()
    died = recorder.end()
    failed = control.recorder.state is RecorderState.FAILED
    return notes + ([str(control.recorder.error)] if failed else died)
