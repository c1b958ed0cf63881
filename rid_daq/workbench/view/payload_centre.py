"""`payload_centre`: centre of gravity from a payload file, for the drawing of the robot."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from config.robot.robot import RobotDescription
from rid_daq.robot_view.scene import RobotScene


def payload_centre(robot: RobotDescription, path: Path) -> tuple[float, float, float] | None:
    """Return a payload's centre of gravity in the frame of the last link [m].

    Args:
        robot: Robot of the cell.
        path: Payload file.

    Returns:
        The place; None if the motion of the payload's runs does not determine it.

    Raises:
        ConfigError: The file cannot be read, is no payload, or is of another robot.
    """
    from identification.payload.file import read_payload
    from rid_daq.operations.cell_files import refuse_other_robot

    estimate = read_payload(path).estimate
    refuse_other_robot(path, estimate.robot, robot)
    on_flange = estimate.reported[1:4]
    if not np.isfinite(on_flange).all():
        return None
    place = RobotScene.of(robot, payload_centre_m=on_flange).payload_centre_m
    assert place is not None
    x, y, z = place.tolist()
    return x, y, z
