"""Starting cell of a robot: drives, bus, cycle and supervision."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from config.cell.cell import CanBusConfig, CellConfig, DriveAxis, Supervision
from config.cell.drive_safety import DriveSafety
from config.quantities import Direction
from config.robot.robot import RobotDescription
from config.robot.urdf_motors import UrdfMotor

VALIDATION_LIMIT_PERCENT: Final = 15.0


def starting_cell(robot: RobotDescription, motors: Sequence[UrdfMotor] | None = None) -> CellConfig:
    """Return a simulated cell that has the robot's name, and drives with the node ids 1, 2, ...

    Args:
        motors: Motors with their directions of rotation; if None, they turn like their joints.
    """
    directions: list[Direction] = [motor.direction for motor in motors or ()]
    directions = directions or [1] * len(robot.joints)
    return CellConfig(
        name=robot.name,
        robot="robot.yaml",
        simulated=True,
        plant="plant.yaml",
        cycle_time_ms=8,
        can=CanBusConfig(interface="rid_sim", channel=robot.name),
        axes=tuple(
            DriveAxis(joint=name, node_id=number, direction=direction)
            for number, (name, direction) in enumerate(
                zip(robot.joint_names, directions, strict=True), start=1
            )
        ),
        position_gain_per_s=10.0,
        supervision=Supervision(
            following_error_min_rad=0.05,
            stuck_encoder_velocity_rad_s=0.2,
            late_by_cycles_limit=8.0,
        ),
        drive_safety=DriveSafety(
            quick_stop_deceleration_rad_s2=max(j.limits.acceleration for j in robot.joints),
            following_error_rad=0.1,
        ),
        validation_limits_percent=(VALIDATION_LIMIT_PERCENT,) * len(robot.joints),
    )
