"""Files that a user names beside a cell: read, and refused where they are of another robot."""

from __future__ import annotations

from pathlib import Path

from acquisition.motion.motion_file import AnyMotion, load_motion
from acquisition.motion.samples import MotionSamples
from compensation.feedforward.file import read_feedforward
from compensation.loops.loop_file import read_loops
from compensation.loops.velocity_loop import VelocityLoop
from config.errors import ConfigError
from config.formats.bounded_file import read_file
from config.formats.yaml_tree import MAX_BYTES
from config.load import LoadedCell
from config.robot.robot import RobotDescription
from identification.estimation.estimate import Estimate
from identification.estimation.file import read_estimate


def motion_for(path: Path, loaded: LoadedCell) -> AnyMotion:
    """Return the motion of a file, for the robot of a cell.

    Raises
    ------
    ConfigError
        It is none, or names another robot than the cell has.
    """
    motion = load_motion(path)
    if motion.robot != loaded.robot.name:
        raise ConfigError(
            f"{path}: robot: is for {motion.robot!r}, cell {loaded.config.name} has"
            f" {loaded.robot.name!r}; make one with `rid-daq design`, or change the name if the"
            " robots are the same"
        )
    return motion


def motion_bytes(motion: AnyMotion, path: Path) -> bytes:
    """Return a motion file as a run folder keeps it: with the rows of a file that it names."""
    return motion.to_keep(read_file(path, MAX_BYTES))


def estimate_for(path: Path, robot: RobotDescription) -> Estimate:
    """Return the model of a file, which must be of a robot.

    Raises
    ------
    ConfigError
        It is none, or of another robot, be it one with the same joint names.
    """
    return require_robot(path, read_estimate(path), robot)


def require_robot(path: Path, estimate: Estimate, robot: RobotDescription) -> Estimate:
    """Return the model of a file, already read; as `estimate_for`."""
    differences = robot.differences(estimate.robot)
    if differences:
        raise ConfigError(
            f"{path}: is of robot {estimate.robot.name!r}, which is not this {robot.name!r}: they"
            f" differ in {', '.join(differences)}. Identify this robot, or correct its file (of an"
            " import: the map's `robot`)"
        )
    return estimate


def loops_for(path: Path, loaded: LoadedCell) -> tuple[VelocityLoop, ...]:
    """Return the velocity loops of a file, of the robot of a cell.

    Raises
    ------
    ConfigError
        It is none, or of another robot.
    """
    robot, loops = read_loops(path)
    if robot != loaded.robot.name:
        raise ConfigError(f"{path}: is of robot {robot!r}, the cell has {loaded.robot.name!r}")
    return loops


def with_feedforward(path: Path, motion: AnyMotion, samples: MotionSamples) -> MotionSamples:
    """Return a planned motion with the feedforward of a file.

    Raises
    ------
    ConfigError
        The file is of another motion, or for another cell.
    """
    file = read_feedforward(path)
    if file.motion != motion:
        raise ConfigError(
            f"{path}: pre-compensates another motion than the one given: make it again with"
            " `rid-daq compensate`"
        )
    return file.onto(samples)
