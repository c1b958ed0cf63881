"""Files that a user names beside a cell: read, and refused where they are of another robot."""

from __future__ import annotations

from pathlib import Path

from acquisition.motion.motion_file import AnyMotion, read_motion
from acquisition.motion.samples import MotionSamples
from compensation.feedforward.file import LARGEST_FILE_BYTES, feedforward_content
from compensation.loops import loop_file
from compensation.loops.velocity_loop import VelocityLoop
from config.errors import ConfigError
from config.formats.json_file import read_content
from config.load import LoadedCell
from config.robot.robot import RobotDescription
from identification.estimation import file as estimate_file
from identification.estimation.estimate import Estimate
from identification.model.still_joints import refuse_still


def motion_for(path: Path, loaded: LoadedCell) -> AnyMotion:
    """Return the motion of a file, for the robot of a cell.

    Raises:
        ConfigError: It is none, or names another robot than the cell has.
    """
    return motion_and_bytes(path, loaded)[0]


def motion_and_bytes(path: Path, loaded: LoadedCell) -> tuple[AnyMotion, bytes]:
    """Return the motion of a file, and the text that a run keeps of it; as `motion_for`."""
    motion, text = read_motion(path)
    if motion.robot != loaded.robot.name:
        raise ConfigError(
            f"{path}: robot: is for {motion.robot!r}, cell {loaded.config.name} has"
            f" {loaded.robot.name!r}; make one with `rid-daq design`, or change the name if the"
            " robots are the same",
            code="RID-ROBOT-OTHER",
        )
    return motion, text


def estimate_for(path: Path, robot: RobotDescription) -> Estimate:
    """Return the model of a file, which must be of a robot, and of which every joint moved.

    Raises:
        ConfigError: It is none, or of another robot, be it one with the same joint names.
        EstimationError: A joint stood still when it was identified.
    """
    return estimate_and_bytes(path, robot)[0]


def estimate_and_bytes(path: Path, robot: RobotDescription) -> tuple[Estimate, bytes]:
    """Return the model of a file, and the file's bytes; as `estimate_for`."""
    data = read_content(path, estimate_file.LARGEST_FILE_BYTES)
    estimate = require_robot(path, estimate_file.estimate_content(data, path), robot)
    refuse_still(estimate.still, str(path))
    return estimate, data


def require_robot(path: Path, estimate: Estimate, robot: RobotDescription) -> Estimate:
    """Return the model of a file, already read; as `estimate_for`."""
    differences = robot.differences(estimate.robot)
    if differences:
        raise ConfigError(
            f"{path}: is of robot {estimate.robot.name!r}, which is not this {robot.name!r}: they"
            f" differ in {', '.join(differences)}. Identify this robot, or correct its file (of an"
            " import: the map's `robot`)",
            code="RID-ROBOT-OTHER",
        )
    return estimate


def loops_and_bytes(path: Path, loaded: LoadedCell) -> tuple[tuple[VelocityLoop, ...], bytes]:
    """Return the velocity loops of a file, of the robot of a cell, and the file's bytes.

    Raises:
        ConfigError: It is none, or of another robot.
    """
    data = read_content(path, loop_file.LARGEST_FILE_BYTES)
    robot, loops = loop_file.loops_content(data, path)
    if robot != loaded.robot.name:
        raise ConfigError(
            f"{path}: is of robot {robot!r}, the cell has {loaded.robot.name!r}",
            code="RID-ROBOT-OTHER",
        )
    return loops, data


def add_feedforward(
    path: Path, motion: AnyMotion, samples: MotionSamples
) -> tuple[MotionSamples, bytes]:
    """Return a planned motion with the feedforward of a file, and the file's bytes.

    Raises:
        ConfigError: The file is of another motion, or for another cell.
    """
    data = read_content(path, LARGEST_FILE_BYTES)
    file = feedforward_content(data, path)
    if file.motion != motion:
        raise ConfigError(
            f"{path}: pre-compensates another motion than the one given: make it again with"
            " `rid-daq compensate`",
            code="RID-FEEDFORWARD-OTHER-MOTION",
        )
    return file.onto(samples), data
