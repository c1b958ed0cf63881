"""`read_gravity`: the torques of gravity from a model file or the robot file's CAD data."""

from __future__ import annotations

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain
from identification.kinematics.gravity import Gravity
from rid_daq.operations.calibration.calibrate_kinematics import CalibrateKinematicsRequest
from rid_daq.operations.calibration.calibrate_poses import CalibratePosesRequest
from rid_daq.operations.cell_files import read_estimate_for, rejection_notes
from rid_daq.operations.stated_payload import state_payload


def read_gravity(
    request: CalibrateKinematicsRequest | CalibratePosesRequest,
    robot: RobotDescription,
    point_m: FloatArray,
) -> tuple[Gravity | None, list[str]]:
    """Return the torques of gravity, None if they are unknown, and notes on their origin.

    Args:
        request: States the model (`cad` of the robot file without one), what the robot carries, and
            the centre of gravity of the known loads.
        robot: The robot.
        point_m: Shape (3,). The measured point in the last link's frame; the centre of the known
            loads if none is stated.

    Raises:
        ConfigError: The model cannot be read, is of another robot, or its payload is not stated.
        EstimationError: The payload failed its verdict, a joint did not move for the model, or
            `identify` rejected the model.
        RecordingError: The model or the payload is in a damaged run, or not of its run.
    """
    load_centre_m = point_m if request.load_centre is None else np.array(request.load_centre)
    model = request.model
    if model is not None:
        estimate = read_estimate_for(model, robot, despite_misfit=request.despite_misfit)
        estimate = state_payload(estimate, model, request.payload, request.runs).estimate
        return Gravity.of_estimate(estimate, load_centre_m), rejection_notes(model, estimate)
    try:
        return Gravity.of_cad(robot, load_centre_m), [
            "the torques of gravity are from `cad` in the robot file; a model of `identify` is more"
            " accurate (--model)"
        ]
    except ConfigError as error:
        return None, [f"the gears count as rigid, because gravity is not known: {error}"]


def stated_point(robot: RobotDescription, point: tuple[float, float, float] | None) -> FloatArray:
    """Return a measured point in the frame of the last link, (3,); the tool point if not stated."""
    return Chain.from_description(robot).tool_m if point is None else np.array(point)
