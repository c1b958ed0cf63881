"""Read the files that a user names in addition to a cell; refuse files of another robot."""

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
from identification.model.still_joints import refuse_unmoved_joints


def read_motion_for(path: Path, loaded: LoadedCell) -> AnyMotion:
    """Return the motion of a file, for the robot of a cell.

    Raises:
        ConfigError: The file is no motion file, or names another robot than the cell's.
    """
    return read_motion_and_bytes(path, loaded)[0]


def read_motion_and_bytes(path: Path, loaded: LoadedCell) -> tuple[AnyMotion, bytes]:
    """Return the motion of a file and the file's bytes; checks are those of `read_motion_for`."""
    motion, text = read_motion(path)
    if motion.robot != loaded.robot.name:
        raise ConfigError(
            f"{path}: robot: the motion is for {motion.robot!r}, but cell {loaded.config.name} has"
            f" {loaded.robot.name!r}; design a motion for this robot with `rid-daq design`, or"
            " change the name in the motion file if the robots are the same",
            code="RID-ROBOT-OTHER",
        )
    return motion, text


def read_estimate_for(path: Path, robot: RobotDescription) -> Estimate:
    """Return the model of a file; it must be of the given robot, and every joint must have moved.

    Raises:
        ConfigError: The file is no model file, or is of another robot, even one with the same joint
            names.
        EstimationError: A joint stood still when the model was identified.
    """
    return read_estimate_and_bytes(path, robot)[0]


def read_estimate_and_bytes(path: Path, robot: RobotDescription) -> tuple[Estimate, bytes]:
    """Return the model of a file and the file's bytes; checks are those of `read_estimate_for`."""
    data = read_content(path, estimate_file.LARGEST_FILE_BYTES)
    estimate = estimate_file.estimate_content(data, path)
    refuse_other_robot(path, estimate.robot, robot)
    refuse_unmoved_joints(estimate.still, str(path))
    return estimate, data


def refuse_other_robot(path: Path, found: RobotDescription, robot: RobotDescription) -> None:
    """Refuse a model or payload of another robot.

    Args:
        path: Name of the model or payload, for messages.
        found: Robot that it belongs to.
        robot: Robot that it is needed for.

    Raises:
        ConfigError: The two differ.
    """
    differences = robot.differences(found)
    if differences:
        raise ConfigError(
            f"{path}: is of robot {found.name!r}, which differs from this {robot.name!r} in"
            f" {', '.join(differences)}. Identify it on this robot, or correct the robot's file"
            " (for an import: `robot` in the map)",
            code="RID-ROBOT-OTHER",
        )


def read_loops_and_bytes(path: Path, loaded: LoadedCell) -> tuple[tuple[VelocityLoop, ...], bytes]:
    """Return the velocity loops of a file, and the file's bytes.

    Raises:
        ConfigError: The file is no loop file, or is of another robot than the cell's.
    """
    data = read_content(path, loop_file.LARGEST_FILE_BYTES)
    robot, loops = loop_file.loops_content(data, path)
    if robot != loaded.robot.name:
        raise ConfigError(
            f"{path}: is of robot {robot!r}, but the cell has {loaded.robot.name!r}: measure the"
            " loops of this cell with `rid-daq loop`",
            code="RID-ROBOT-OTHER",
        )
    return loops, data


def add_feedforward(
    path: Path, motion: AnyMotion, samples: MotionSamples
) -> tuple[MotionSamples, bytes]:
    """Add the feedforward of a file to a planned motion; return the motion and the file's bytes.

    Raises:
        ConfigError: The file is of another motion, or for another cell.
    """
    data = read_content(path, LARGEST_FILE_BYTES)
    file = feedforward_content(data, path)
    if file.motion != motion:
        raise ConfigError(
            f"{path}: the feedforward belongs to another motion than the given one: compute it"
            " again with `rid-daq compensate`",
            code="RID-FEEDFORWARD-OTHER-MOTION",
        )
    return file.onto(samples), data
