"""`propose_poses`: choose poses for a calibration, and write their table and motions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.motion.kinds.pose_sequence import PoseSequenceMotion
from config.arrays import BoolArray
from config.errors import ConfigError
from config.formats.whole_file import write_whole
from config.load import load_cell, load_robot, to_yaml
from config.robot.bodies import Workspace
from config.robot.robot import RobotDescription
from dynamics.geometry.clearances import Clearances
from identification.kinematics.calibration import nominal_arm
from identification.kinematics.pose_design import PoseDesign, design_poses
from rid_daq.operations.calibration.calibrate_poses import CalibratePosesRequest
from rid_daq.operations.calibration.gravity_source import read_gravity, stated_point
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output

_CHECK_PERIOD_S: Final = 0.01


@dataclass(frozen=True)
class ProposedPoses:
    """Poses that were chosen and written.

    Attributes:
        robot: The robot.
        design: The poses.
        files: The files that were written.
        notes: Assumptions, one sentence each.
    """

    robot: RobotDescription
    design: PoseDesign
    files: tuple[Path, ...]
    notes: list[str]


def propose_poses(request: CalibratePosesRequest) -> ProposedPoses:
    """Choose the poses, and write them.

    Raises:
        ConfigError: A file is invalid or exists already, the cell has another robot, or too few
            poses are clear of obstacles.
        EstimationError: The payload failed its verdict, or a joint did not move for the model.
        RecordingError: A file cannot be written, or the model is in a damaged run.
        DataQualityError: The number of poses is too small for the parameters.
    """
    outputs = {request.output: made_file.POSES}
    for path in (request.motion, request.loaded_motion):
        if path is not None and path in outputs:
            raise ConfigError(
                f"{path}: two outputs have the same name: give each its own",
                code="RID-OPTION-EXCLUSIVE",
            )
        if path is not None:
            outputs[path] = made_file.MOTION
    for path, made in outputs.items():
        refuse_output(path, request.overwrite, made)
    robot = load_robot(request.robot)
    point = stated_point(robot, request.point)
    gravity, notes = read_gravity(request, robot, point)
    clearances = Clearances.of(robot, _workspace(request, robot))
    if not robot.bodies:
        notes.append(
            "the robot file has no `bodies`: collisions of the links are not checked, only the"
            " tool point and the workspace"
        )
    design = design_poses(
        nominal_arm(robot, gravity, point),
        robot,
        clearances,
        count=request.count,
        load_kg=request.load,
        range_fraction=request.range_fraction,
        seed=request.seed,
    )
    motions = [
        (path, _motion(request, robot, design, rows, clearances))
        for path, rows in (
            (request.motion, design.load_kg == 0.0),
            (request.loaded_motion, design.load_kg > 0.0),
        )
        if path is not None
    ]
    write_whole(request.output, "\n".join(_table_lines(robot, design)).encode())
    comment = f"Poses of {request.output.name} by `rid-daq calibrate poses`."
    for path, motion in motions:
        write_whole(path, to_yaml(motion, comment).encode())
    return ProposedPoses(robot, design, tuple(outputs), notes)


def _workspace(request: CalibratePosesRequest, robot: RobotDescription) -> Workspace:
    if request.cell is None:
        return Workspace()
    loaded = load_cell(request.cell)
    if loaded.robot.name != robot.name:
        raise ConfigError(
            f"{request.cell}: has the robot {loaded.robot.name!r}, but poses of {robot.name!r} are"
            " requested: give a cell with this robot",
            code="RID-ROBOT-OTHER",
        )
    return loaded.config.workspace


def _motion(
    request: CalibratePosesRequest,
    robot: RobotDescription,
    design: PoseDesign,
    rows: BoolArray,
    clearances: Clearances,
) -> PoseSequenceMotion:
    """Return the motion through some of the poses, checked against the limits."""
    stops = np.round(design.stops(rows, clearances), 6)
    motion = PoseSequenceMotion(
        kind="pose_sequence",
        robot=robot.name,
        points=tuple(tuple(pose) for pose in stops.tolist()),
        speed_fraction=request.speed_fraction,
        dwell_s=request.dwell,
    )
    motion.plan(robot, _CHECK_PERIOD_S)
    return motion


def _table_lines(robot: RobotDescription, design: PoseDesign) -> Iterator[str]:
    """Yield the lines of the table; the columns of the measured point are empty."""
    nominal = ("nominal_x_m", "nominal_y_m", "nominal_z_m")
    yield ",".join(("pose", *robot.joint_names, "load_kg", "x_m", "y_m", "z_m", *nominal))
    for number, (pose, load, point) in enumerate(
        zip(np.round(design.position, 6), design.load_kg, design.point_m, strict=True), start=1
    ):
        joints = (f"{value:.6f}" for value in pose)
        places = (f"{value:.4f}" for value in point)
        yield ",".join((str(number), *joints, f"{load:g}", "", "", "", *places))
    yield ""
