"""`run_robot_blocks`: pictures of the robot of a run."""

from __future__ import annotations

from collections.abc import Iterator

from acquisition.runs.folder import RunFolder
from config.cell.cell import CellConfig
from config.errors import RidDaqError
from config.load import load_bundled_or_path, load_robot
from config.robot.robot import RobotDescription
from rid_daq.blocks.block import AnyBlock, Heading, Text
from rid_daq.report.result import Result
from rid_daq.runs.run_data import CELL, ROBOT


def run_robot_blocks(folder: RunFolder, result: Result) -> Iterator[AnyBlock]:
    """Yield views of the robot as it was in a run, and of its payload.

    The robot is drawn at the start of the first motion of the result. Nothing is yielded for a run
    without a robot file.

    Args:
        folder: The run.
        result: Result of the run.
    """
    files = folder.manifest().files
    if ROBOT not in files:
        return
    yield Heading(text="Robot")
    names = [name for name in files if name in (ROBOT, CELL) or name.endswith(".meshes")]
    changed = [name for name in names if not folder.is_unchanged(name, files[name])]
    if changed:
        yield Text(text=f"The robot is not drawn, because {', '.join(changed)} was changed.")
        return
    try:
        yield from _pictures(folder, names, result)
    except RidDaqError as error:  # a picture must not prevent the report
        yield Text(text=f"The robot is not drawn: {error}")


def _pictures(folder: RunFolder, names: list[str], result: Result) -> list[AnyBlock]:
    """Return views of the robot and of its payload.

    Raises:
        ConfigError: The robot file, its meshes or the cell file is invalid.
    """
    from rid_daq.robot_view.robot_pictures import flange_picture, robot_picture

    robot = load_robot(str(folder.file(ROBOT)))
    meshes = None
    if robot.meshes is not None and robot.meshes.file in names:
        meshes = robot.meshes.read(folder.path)
    plate = None
    if CELL in names:
        plate = load_bundled_or_path(str(folder.file(CELL)), "cells", CellConfig).plate
    centre = _payload_centre(result)
    views: list[AnyBlock] = [robot_picture(robot, plate, _start(result, robot), centre, meshes)]
    return views if centre is None else [*views, flange_picture(robot, centre, meshes)]


def _start(result: Result, robot: RobotDescription) -> tuple[float, ...] | None:
    """Return the joint positions at the start of the first motion; None if they are unknown."""
    axes = result.runs[0].axes if result.runs else ()
    found = {axis.joint: axis.position_start for axis in axes}
    start = [found.get(name) for name in robot.joint_names]
    known = tuple(position for position in start if position is not None)
    return known if len(known) == len(start) else None


def _payload_centre(result: Result) -> tuple[float, float, float] | None:
    """Return the payload's centre of gravity in the flange's frame [m]; None if it is unknown."""
    if result.payload is None:
        return None
    values = [each.value for each in result.payload.parameters[1:4]]
    known = [value for value in values if value is not None]
    return (known[0], known[1], known[2]) if len(known) == 3 else None
