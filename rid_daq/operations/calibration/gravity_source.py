"""`read_gravity`: the torques of gravity from a model file or the robot file's CAD data."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain
from identification.kinematics.gravity import Gravity
from rid_daq.operations.cell_files import read_estimate_for, rejection_notes
from rid_daq.operations.stated_payload import state_payload


def read_gravity(
    robot: RobotDescription,
    model: Path | None,
    payload: str | None,
    runs: Path,
    load_centre_m: FloatArray,
    *,
    despite_misfit: bool,
) -> tuple[Gravity | None, list[str]]:
    """Return the torques of gravity, None if they are unknown, and notes on their origin.

    Args:
        robot: The robot.
        model: Model file of `identify`; `cad` of the robot file if None.
        payload: What the robot carries besides known loads, as in `state_payload`.
        runs: Folder of the run folders.
        load_centre_m: Shape (3,). Centre of gravity of the known loads in the last link's frame.
        despite_misfit: True if a model that `identify` rejected is accepted.

    Raises:
        ConfigError: The model cannot be read, is of another robot, or its payload is not stated.
        EstimationError: The payload failed its verdict, a joint did not move for the model, or
            `identify` rejected the model.
        RecordingError: The model or the payload is in a damaged run, or not of its run.
    """
    if model is not None:
        estimate = read_estimate_for(model, robot, despite_misfit=despite_misfit)
        estimate = state_payload(estimate, model, payload, runs).estimate
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
