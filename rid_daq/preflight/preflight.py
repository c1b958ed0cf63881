"""`preflight`: check the devices and the safety settings of a cell.

A red line means: do not move the robot. Motion commands in a terminal repeat only a part of the
checks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from config.cell.cell import CellConfig
from config.errors import DriverError, RidDaqError
from config.load import LoadedCell
from drivers.settings.write_log import WriteLog
from rid_daq.preflight.axis_test import AxisTestRule, axis_test_line
from rid_daq.preflight.bus_check import bus_lines, load_line
from rid_daq.preflight.check_line import CheckLine
from rid_daq.preflight.computer_check import disk_lines, time_lines
from rid_daq.preflight.drives_check import DriveTrouble, check_drives
from rid_daq.preflight.eds_check import eds_lines
from rid_daq.preflight.last_pose import PoseRule, pose_lines
from rid_daq.preflight.monitor_check import monitor_lines
from rid_daq.preflight.plate_check import PlateCheck


def _ignore_lines(_lines: Sequence[CheckLine]) -> None:
    pass


def lines_before_bus(
    loaded: LoadedCell, runs: Path, axis_test: AxisTestRule = AxisTestRule.REQUIRED
) -> list[CheckLine]:
    """Return the results of checks that need no connection to the cell.

    These are bus load, disk, axis test, geometry, and the drives' torque filter.
    """
    geometry = [
        CheckLine("robot file", "fixed angles under kinematics", "exact", note, "ok")
        for note in loaded.robot.kinematics.notes
    ]
    return [
        load_line(loaded.config),
        *disk_lines(runs),
        axis_test_line(loaded, axis_test),
        *geometry,
        *_filter_lines(loaded.config),
    ]


def _filter_lines(cell: CellConfig) -> list[CheckLine]:
    """Return a line if frequencies above half the cycle frequency pass the torque filter."""
    half_hz = 0.5 / cell.cycle_time_s
    if cell.torque_filter is None or cell.torque_filter.cutoff_hz <= half_hz:
        return []
    found = (
        f"{cell.torque_filter.cutoff_hz:g} Hz: frequencies above {half_hz:g} Hz alias in the"
        " recorded torque; shorten cycle_time_ms, or set a lower filter in the drives"
    )
    required = f"≤ {half_hz:g} Hz, half the cycle frequency"
    what = "torque_filter.cutoff_hz"
    return [CheckLine("cell file", what, required, found, "shown", headline="Aliased torque")]


def preflight(
    loaded: LoadedCell,
    reachable: CellConfig,
    before: Sequence[CheckLine],
    seconds: float,
    *,
    cleared: bool,
    write_log: WriteLog | None = None,
    tell: Callable[[Sequence[CheckLine]], None] = _ignore_lines,
    pose: PoseRule = PoseRule.COMPARED,
) -> tuple[list[CheckLine], RidDaqError | None]:
    """Return the lines of the preflight of a reachable cell, and the error that ended it early.

    Args:
        loaded: The cell and its files.
        reachable: The cell with a bus that this program can open.
        before: Lines of `lines_before_bus`; they come first.
        seconds: Time during which answers are counted [s].
        cleared: True if a person has confirmed that the cell is clear; only then can the watchdog
            test switch drives on.
        write_log: Log of the writes to the drives; None to keep none.
        tell: Function that is called with the lines of some devices as soon as they are complete,
            but not with `before`.
        pose: Whether the last pose is compared, replaced by the present one, or left out.

    Raises:
        ConfigError, RecordingError: The file with the last pose cannot be used.
        LockedError: Another master is active on the bus.
    """
    eds_files = eds_lines(loaded)
    computer = [*bus_lines(reachable), *time_lines()]
    tell(computer)
    lines = [*before, *computer]
    plate = PlateCheck(reachable, loaded.amplifier_profile)
    problem = _try_step(plate.before)
    drives = [*eds_files, *monitor_lines(reachable, loaded.robot, loaded.drive_profile)]
    position: list[float] = []
    fit = all(line.verdict != "red" for line in eds_files)
    try:
        if fit:
            found, position = check_drives(
                reachable, loaded.robot, seconds, write_log, cleared=cleared
            )
            drives += [*found, *pose_lines(loaded, position, pose)]
    except DriveTrouble as trouble:
        drives += trouble.lines
        problem = trouble.error
    tell(drives)
    if fit and problem is None:
        problem = _try_step(lambda: plate.after(position))
    tell(plate.lines)
    return [*lines, *plate.lines, *drives], problem


def _try_step(step: Callable[[], object]) -> RidDaqError | None:
    """Perform a step of the plate's check; return its error, so that the preflight continues."""
    try:
        step()
    except DriverError as error:
        return error
    return None
