"""The drive monitor's side of a recorded motion, as the program sees it."""

from __future__ import annotations

import os

from acquisition.journal.monitor import MONITOR, MonitorHeader
from acquisition.runs.folder import RunFolder
from acquisition.session.drive_monitor import run_monitor
from acquisition.session.helper_process import HelperProcess
from acquisition.task.control_block import ControlBlock
from acquisition.task.states import MonitorState
from config.cell.cell import CellConfig
from config.cell.drive_profile import DriveProfile
from config.errors import DriverError
from config.load import load_bundled_or_path
from config.robot.robot import RobotDescription

PATIENCE_S = 30.0


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
        control.monitor.fail(DriverError("the process that asks the drives has died"))
