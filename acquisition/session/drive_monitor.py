"""The drive monitor: a process that reads the drives' temperatures.

It cannot delay the cyclic task: if it hangs, fails or dies, the motion continues. In lock-step,
however, simulated time waits for it.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np

from acquisition.journal.monitor import MONITOR, MonitorHeader, MonitorWriter
from acquisition.runs.folder import RunFolder
from acquisition.session.helper_process import HelperProcess
from acquisition.task.control_block import ControlBlock
from acquisition.task.states import MonitorState, Pace
from config.cell.cell import CellConfig
from config.cell.drive_profile import DriveProfile
from config.cell.monitor import MonitorConfig
from config.errors import DriverError
from config.load import load_bundled_or_path
from config.process.shortage import named_error
from config.process.termination import leave_terminal
from config.robot.robot import RobotDescription
from drivers.interfaces.drive_monitor import DriveMonitor, MonitorReading
from drivers.modbus.drive_monitor import open_drive_monitor

LOOK_S = 0.02
LOCKSTEP_LOOK_S = 0.0005
PATIENCE_S = 30.0


def run_monitor(
    config: MonitorConfig,
    profile: DriveProfile,
    control: ControlBlock,
    path: Path,
    header: MonitorHeader,
    parent: int,
) -> None:
    """Run the monitor; main function of its process. It ends with the cyclic task or the program.

    Args:
        config, profile: Addresses and registers of the drives.
        control: Shared state of the motion's processes; the monitor reports its state there and
            reads when to poll.
        path: File to write.
        header: Header of the file.
        parent: Process id of the program.
    """
    leave_terminal()
    try:
        with open_drive_monitor(config, profile) as monitor, MonitorWriter(path, header) as writer:
            control.monitor.state = MonitorState.POLLING
            while control.task.pace is Pace.UNKNOWN and not _is_over(control, parent):
                time.sleep(LOOK_S)
            if control.task.pace is Pace.LOCKSTEP:
                _poll_on_request(monitor, writer, control, parent)
            else:
                _poll_periodically(monitor, writer, control, config.period_s, parent)
        control.monitor.state = MonitorState.FINISHED
    except Exception as error:
        control.monitor.fail(named_error(error))


def _poll_periodically(
    monitor: DriveMonitor,
    writer: MonitorWriter,
    control: ControlBlock,
    period_s: float,
    parent: int,
) -> None:
    due_s = time.monotonic()
    while not _is_over(control, parent):
        now_s = time.monotonic()
        if now_s < due_s:
            time.sleep(min(LOOK_S, due_s - now_s))
            continue
        reading = _poll_drives(monitor, control)
        writer.append(0.5 * (now_s + time.monotonic()), reading)
        due_s += period_s * max(1, int((time.monotonic() - due_s) / period_s) + 1)


def _poll_on_request(
    monitor: DriveMonitor, writer: MonitorWriter, control: ControlBlock, parent: int
) -> None:
    while not _is_over(control, parent):
        if control.monitor.rounds >= control.task.rounds_requested:
            time.sleep(LOCKSTEP_LOOK_S)
            continue
        reading = _poll_drives(monitor, control)
        writer.append(control.task.round_requested_s, reading)
        control.monitor.count_round()


def _poll_drives(monitor: DriveMonitor, control: ControlBlock) -> MonitorReading:
    """Poll every drive once; a lost connection is tried again in the next round."""
    try:
        reading = monitor.read()
    except DriverError as error:
        nothing = np.full(control.program.monitored, np.nan)
        reading = MonitorReading(nothing, nothing.copy(), (str(error),))
    control.monitor.show_temperatures(reading.temperature_k.tolist(), reading.problems)
    return reading


def _is_over(control: ControlBlock, parent: int) -> bool:
    return control.task_gone or os.getppid() != parent


def create_monitor_process(
    cell: CellConfig,
    robot: RobotDescription,
    profile: DriveProfile | None,
    control: ControlBlock,
    folder: RunFolder,
) -> HelperProcess | None:
    """Return the process that will read the drives' temperatures; None without a monitor.

    Raises:
        ConfigError: The register profile that the cell names cannot be read.
    """
    if cell.monitor is None:
        return None
    if profile is None:
        profile = load_bundled_or_path(cell.monitor.profile, "profiles", DriveProfile)
    control.program.announce_monitor(len(robot.joints))
    header = MonitorHeader(
        joint_names=robot.joint_names,
        period_s=cell.monitor.period_s,
        cell_name=cell.name,
        robot_name=robot.name,
        run_id=folder.run_id,
    )
    arguments = (cell.monitor, profile, control, folder.file(MONITOR), header, os.getpid())
    return HelperProcess("drive monitor", run_monitor, arguments, patience_s=PATIENCE_S)


def end_monitor(monitor: HelperProcess, control: ControlBlock) -> list[str]:
    """End the drive monitor after the motion, and return notes about it."""
    notes = monitor.end()
    if monitor.exit_code:
        mark_monitor_dead(control)
    if control.monitor.state is MonitorState.FAILED:
        return [control.monitor.note]
    return [*notes, *filter(None, [control.monitor.note])]


def mark_monitor_dead(control: ControlBlock) -> None:
    """Mark the monitor, whose process has died, as failed, so that no process waits for it."""
    if control.monitor.working:
        control.monitor.fail(
            DriverError(
                "the process that reads the drives' temperatures has died",
                code="RID-SYSTEM-PROCESS-DIED",
            )
        )
