"""Processes beside a motion that it can do without: the drive monitor, and who looks on."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from multiprocessing import get_context
from multiprocessing.context import SpawnProcess

from acquisition.journal.monitor_row import MONITOR, MonitorHeader
from acquisition.runs.folder import RunFolder
from acquisition.session.drive_monitor import run_monitor
from acquisition.task.control_block import ControlBlock, MonitorState
from acquisition.task.ring import Ring
from config.cell.cell import CellConfig
from config.cell.drive_profile import DriveProfile
from config.load import load_bundled_or_path
from config.process.shortage import as_named
from config.process.termination import termination_held
from config.robot.robot import RobotDescription

MONITOR_PATIENCE_S = 30.0
ONLOOKER_PATIENCE_S = 2.0

Onlooker = Callable[[Ring, ControlBlock], SpawnProcess]
"""Makes, not starts, a process that may look at ring and control block, and ask for a stop."""


def monitor_process(
    cell: CellConfig,
    robot: RobotDescription,
    profile: DriveProfile | None,
    control: ControlBlock,
    folder: RunFolder,
) -> SpawnProcess | None:
    """Return the process that will ask the drives for temperatures, where the cell has a way."""
    if cell.monitor is None:
        return None
    if profile is None:
        profile = load_bundled_or_path(cell.monitor.profile, "profiles", DriveProfile)
    control.announce_monitor(len(robot.joints))
    header = MonitorHeader(
        joint_names=robot.joint_names,
        period_s=cell.monitor.period_s,
        cell_name=cell.name,
        robot_name=robot.name,
        run_id=folder.run_id,
    )
    return get_context("spawn").Process(
        target=run_monitor,
        args=(cell.monitor, profile, control, folder.file(MONITOR), header, os.getpid()),
        name="rid-daq drive monitor",
    )


def start_processes(processes: Sequence[SpawnProcess]) -> None:
    """Start all of them or none, the cyclic task last: nothing has moved where one fails.

    Raises
    ------
    ShortageError
        The computer cannot start one more.
    """
    try:
        with termination_held(apart=True):
            for process in processes:
                process.start()
    except Exception as error:
        for process in processes:
            if process.pid is not None:
                process.kill()
                process.join()
        raise as_named(error) from error


def end_monitor(monitor: SpawnProcess | None, control: ControlBlock) -> list[str]:
    """End the drive monitor after the motion; return what there is to say about it."""
    if monitor is None:
        return []
    monitor.join(MONITOR_PATIENCE_S)
    notes = []
    if monitor.is_alive():
        notes.append("the drive monitor did not finish and was killed; its file is not closed")
        monitor.kill()
        monitor.join()
    elif monitor.exitcode != 0:
        control.declare_monitor_dead()
    monitor.close()
    if control.monitor_state is MonitorState.FAILED:
        notes.append(f"no temperatures from here on: {control.monitor_error}")
    elif control.monitor_error:
        notes.append(control.monitor_error)
    return notes


def end_onlooker(onlooker: SpawnProcess | None) -> list[str]:
    """End an onlooker after the motion; return what there is to say about it."""
    if onlooker is None:
        return []
    onlooker.join(ONLOOKER_PATIENCE_S)
    died = onlooker.exitcode
    if onlooker.is_alive():
        onlooker.kill()
        onlooker.join()
    onlooker.close()
    return [f"the live page died (exit code {died}); the motion was not affected"] if died else []
