"""Read the files that a user names in addition to a cell; refuse files of another robot."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from acquisition.motion.load_changes import LoadChanges
from acquisition.motion.motion_file import AnyMotion, read_motion
from acquisition.motion.samples import MotionSamples
from compensation.feedforward.file import LARGEST_FILE_BYTES, feedforward_content
from compensation.loops import loop_file
from compensation.loops.velocity_loop import VelocityLoop
from config.cell.cell import CellConfig
from config.errors import ConfigError, EstimationError
from config.formats.json_file import read_content
from config.load import LoadedCell
from config.robot.robot import RobotDescription
from identification.estimation.estimate import Estimate, refuse_external_model
from identification.model.still_joints import refuse_unmoved_joints
from rid_daq.runs.run_model import read_model_and_bytes


@dataclass(frozen=True)
class LoopsForCell:
    """Velocity loops of a cell's robot.

    Attributes:
        loops: The loops.
        content: Bytes of their file.
        notes: Reasons to doubt the loops: another cell, or a bad fit.
    """

    loops: tuple[VelocityLoop, ...]
    content: bytes
    notes: tuple[str, ...]


def read_motion_for(path: Path, loaded: LoadedCell) -> AnyMotion:
    """Return the motion of a file, for the robot of a cell.

    Raises:
        ConfigError: The file is not a motion file, or names another robot than the cell's.
    """
    return read_motion_and_bytes(path, loaded)[0]


def read_motion_and_bytes(path: Path, loaded: LoadedCell) -> tuple[AnyMotion, bytes]:
    """Return the motion of a file and the file's bytes; checks are those of `read_motion_for`."""
    motion, text = read_motion(path)
    refuse_other_robot_motion(path, motion, loaded)
    return motion, text


def refuse_other_robot_motion(path: Path, motion: AnyMotion, loaded: LoadedCell) -> None:
    """Raise an error for the motion of another robot.

    Args:
        path: File of the motion.
        motion: The motion.
        loaded: Cell that will execute it.

    Raises:
        ConfigError: The motion names another robot than the cell's.
    """
    if motion.robot != loaded.robot.name:
        raise ConfigError(
            f"{path}: robot: the motion is for {motion.robot!r}, but cell {loaded.config.name} has"
            f" {loaded.robot.name!r}; design a motion for this robot with `rid-daq design`, or"
            " change the name in the motion file if the robots are the same",
            code="RID-ROBOT-OTHER",
        )


def read_estimate_for(path: Path, robot: RobotDescription, *, despite_misfit: bool) -> Estimate:
    """Return the model of a file; it must be of the given robot, and every joint must have moved.

    Args:
        path: The model file.
        robot: The robot that it is needed for.
        despite_misfit: True if a model that `identify` rejected is accepted.

    Raises:
        ConfigError: The file is not a model file, or is of another robot, even one with the same
            joint names.
        RecordingError: The file is in the folder of a run, and is not the model of this run; or a
            file of this run has changed.
        EstimationError: A joint did not move when the model was identified, or `identify` rejected
            the model.
    """
    return read_estimate_and_bytes(path, robot, despite_misfit=despite_misfit)[0]


def read_estimate_and_bytes(
    path: Path, robot: RobotDescription, *, despite_misfit: bool
) -> tuple[Estimate, bytes]:
    """Return the model of a file and the file's bytes; checks are those of `read_estimate_for`."""
    estimate, data = read_model_and_bytes(path)
    refuse_other_robot(path, estimate.robot, robot)
    refuse_unmoved_joints(estimate.still, str(path))
    refuse_rejected_model(estimate, str(path), despite_misfit=despite_misfit)
    return estimate, data


def read_torque_model(
    path: Path, robot: RobotDescription, *, despite_misfit: bool
) -> tuple[Estimate, bytes]:
    """Return a model that predicts the motors' torques, and the file's bytes.

    Args:
        path, robot, despite_misfit: As for `read_estimate_for`.

    Raises:
        EstimationError: The model is external, without friction and inertia of the motors.
        RidDaqError: As `read_estimate_for`.
    """
    estimate, data = read_estimate_and_bytes(path, robot, despite_misfit=despite_misfit)
    try:
        refuse_external_model(estimate)
    except EstimationError as error:
        raise EstimationError(f"{path}: {error}", code=error.refusal) from error
    return estimate, data


def refuse_rejected_model(estimate: Estimate, name: str, *, despite_misfit: bool) -> None:
    """Refuse a model that `identify` rejected with exit code 6.

    Args:
        estimate: The model.
        name: Name of the model, for messages.
        despite_misfit: True if the model is accepted nevertheless.

    Raises:
        EstimationError: `identify` rejected the model, and `despite_misfit` is False.
    """
    if estimate.objections and not despite_misfit:
        raise EstimationError(
            f"{name}: `identify` rejected this model. {' '.join(estimate.objections)} Correct the"
            " files and identify again, or use the model nevertheless (--despite-misfit)",
            code="RID-MODEL-MISFIT",
        )


def rejection_notes(path: Path, estimate: Estimate) -> list[str]:
    """Return a note with the reasons for which `identify` rejected a model; otherwise none."""
    if not estimate.objections:
        return []
    why = " ".join(estimate.objections)
    return [f"{path}: `identify` rejected this model, so its torques can be wrong. {why}"]


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
            f"{path}: belongs to robot {found.name!r}, but robot {robot.name!r} is used here; their"
            f" descriptions differ in {', '.join(differences)}. Identify again with the robot used"
            " here, or correct the wrong robot file (for an imported run: `robot` in the map)",
            code="RID-ROBOT-OTHER",
        )


def read_loops_for(path: Path, robot: RobotDescription, cell: CellConfig) -> LoopsForCell:
    """Return the velocity loops of a file; they must be of the cell's robot.

    Raises:
        ConfigError: The file is not a loop file, has a loop of a joint that the robot does not
            have, or is of another robot.
    """
    data = read_content(path, loop_file.LARGEST_FILE_BYTES)
    file, loops = loop_file.loops_content(data, path)
    foreign = [loop.joint_name for loop in loops if loop.joint_name not in robot.joint_names]
    if file.robot != robot.name or foreign:
        also = f", with loops of {', '.join(foreign)}" if foreign else ""
        raise ConfigError(
            f"{path}: is of robot {file.robot!r}{also}, but the cell has {robot.name!r} with"
            f" {', '.join(robot.joint_names)}: measure the loops of this cell with `rid-daq loop`",
            code="RID-ROBOT-OTHER",
        )
    notes = []
    if file.cell and file.cell != cell.name:
        notes.append(
            f"{path} was measured in cell {file.cell}, but cell {cell.name} is used here: if its"
            " drives have other settings, measure their loops with `rid-daq loop`"
        )
    misfits = [
        f"{one.joint_name} (misfit {100.0 * one.misfit:.2g} %, p = {one.p_value:.2g})"
        for one in loops
        if not one.is_explained
    ]
    if misfits:
        notes.append(
            f"{path}: a proportional-integral controller does not explain the measured loop of"
            f" {', '.join(misfits)}, so the feedforward of these joints can be wrong: look for"
            " filters in the drive, and run `rid-daq loop` again"
        )
    return LoopsForCell(loops, data, tuple(notes))


def add_feedforward(
    path: Path, motion: AnyMotion, samples: MotionSamples
) -> tuple[MotionSamples, bytes, LoadChanges | None]:
    """Add the feedforward of a file to a planned motion.

    Returns:
        The motion, the file's bytes, and the changes of the payload during the motion.

    Raises:
        ConfigError: The file is of another motion, cycle time or robot.
    """
    data = read_content(path, LARGEST_FILE_BYTES)
    file = feedforward_content(data, path)
    if file.motion != motion:
        raise ConfigError(
            f"{path}: the feedforward belongs to another motion than the given one: compute it"
            " again with `rid-daq compensate`",
            code="RID-FEEDFORWARD-OTHER-MOTION",
        )
    return file.onto(samples), data, file.origin.load_changes
