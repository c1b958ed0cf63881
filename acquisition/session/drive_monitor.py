"""The drive monitor: a process of its own that asks the drives for their temperatures.

Nothing in it can hold up the cyclic task: it may hang, fail or die, and the motion goes on. In
lock-step it is the other way round: simulated time stands still while it asks.
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
    """Run the monitor; the main function of its process. It ends with the cyclic task.

    Args:
        config, profile: Whom to ask, and for what.
        control: Where it says how it fares, and learns when to ask.
        path: The file to write.
        header: What the file says about itself.
        parent: Process id of the program.
    """
    leave_terminal()
    try:
        with open_drive_monitor(config, profile) as monitor, MonitorWriter(path, header) as writer:
            control.monitor.state = MonitorState.POLLING
            while control.task.pace is Pace.UNKNOWN and not _over(control, parent):
                time.sleep(LOOK_S)
            if control.task.pace is Pace.LOCKSTEP:
                _answer_questions(monitor, writer, control, parent)
            else:
                _ask_regularly(monitor, writer, control, config.period_s, parent)
        control.monitor.state = MonitorState.FINISHED
    except Exception as error:
        control.monitor.fail(named_error(error))


def _ask_regularly(
    monitor: DriveMonitor,
    writer: MonitorWriter,
    control: ControlBlock,
    period_s: float,
    parent: int,
) -> None:
    due_s = time.monotonic()
    while not _over(control, parent):
        now_s = time.monotonic()
        if now_s < due_s:
            time.sleep(min(LOOK_S, due_s - now_s))
            continue
        reading = _round(monitor, control)
        writer.append(0.5 * (now_s + time.monotonic()), reading)
        due_s += period_s * max(1, int((time.monotonic() - due_s) / period_s) + 1)


def _answer_questions(
    monitor: DriveMonitor, writer: MonitorWriter, control: ControlBlock, parent: int
) -> None:
    while not _over(control, parent):
        if control.monitor.rounds >= control.task.rounds_asked:
            time.sleep(LOCKSTEP_LOOK_S)
            continue
        reading = _round(monitor, control)
        writer.append(control.task.round_asked_s, reading)
        control.monitor.count_round()


def _round(monitor: DriveMonitor, control: ControlBlock) -> MonitorReading:
    """Ask every drive once; a line that is gone is tried again in the next round."""
    try:
        reading = monitor.read()
    except DriverError as error:
        nothing = np.full(control.program.monitored, np.nan)
        reading = MonitorReading(nothing, nothing.copy(), (str(error),))
    control.monitor.show_temperatures(reading.temperature_k.tolist(), reading.problems)
    return reading


def _over(control: ControlBlock, parent: int) -> bool:
    return control.task_gone or os.getppid() != parent


def monitor_process(
    cell: CellConfig,
    robot: RobotDescription,
    profile: DriveProfile | None,
    control: ControlBlock,
    folder: RunFolder,
) -> HelperProcess | None:
    """Return the process that will ask the drives for temperatures, where the cell has a way."""
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
    """End the drive monitor after the motion; return what there is to say about it."""
    notes = monitor.end()
    if monitor.exit_code:
        declare_dead(control)
    if control.monitor.state is MonitorState.FAILED:
        return [control.monitor.note]
    return [*notes, *filter(None, [control.monitor.note])]


def declare_dead(control: ControlBlock) -> None:
    """Let nobody wait for a monitor whose process has ended without a word."""
    if control.monitor.working:
        control.monitor.fail(
            DriverError("the process that asks the drives has died", code="RID-SYSTEM-PROCESS-DIED")
        )
