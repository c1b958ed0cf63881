"""Checks of a cell file against the robot file: home pose, signs of the gears, stops."""

from __future__ import annotations

from typing import Final

from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.formats.yaml_tree import YamlTree
from config.plausible import Path, key_name
from config.robot.robot import RobotDescription

STEEPEST_STOP: Final = 10.0
"""Largest plausible deceleration of a stop, relative to the robot's largest acceleration limit.

A motor cannot brake a joint many times as fast as it accelerates it. A value that is given in
degrees/s² by mistake is 57 times as large.
"""


def check_robot_fit(tree: YamlTree, cell: CellConfig, robot: RobotDescription) -> None:
    """Refuse values of a cell file that contradict its robot file.

    Args:
        tree: The cell file, for the line of an error.
        cell, robot: The cell, with one axis per joint of the robot in the robot's order.

    Raises:
        ConfigError: The home pose is outside the limits, the sign of a gear is stated in two ways,
            or a deceleration is implausible for the robot.
    """
    _check_home(tree, cell, robot)
    _check_directions(tree, cell, robot)
    _check_stops(tree, cell, robot)


def _check_home(tree: YamlTree, cell: CellConfig, robot: RobotDescription) -> None:
    for number, (value, joint) in enumerate(zip(cell.home or (), robot.joints, strict=False)):
        low, high = joint.limits.position_min, joint.limits.position_max
        if not low <= value <= high:
            raise ConfigError(
                f"{tree.where(('home', number))}: home: {joint.name} is at {value:g}, outside"
                f" its limits {low:g} to {high:g}; give a position within the limits",
                code="RID-CELL-VALUE",
            )


def _check_directions(tree: YamlTree, cell: CellConfig, robot: RobotDescription) -> None:
    """Refuse a negative gear ratio whose drive counts in the direction of the joint.

    A drive's counts are converted with the magnitude of `gear_ratio` and the sign `direction`.
    """
    for number, (axis, joint) in enumerate(zip(cell.axes, robot.joints, strict=True)):
        if joint.gear_ratio < 0.0 < axis.direction:
            raise ConfigError(
                f"{tree.where(('axes', number))}: direction of {joint.name} is 1, but its"
                f" gear_ratio in the robot file is {joint.gear_ratio:g}: only direction gives the"
                f" sign of the drive's counts. State gear_ratio: {-joint.gear_ratio:g} (and, if it"
                " has a rotor, reverse the rotor's axis), or direction: -1 if positive counts turn"
                " the joint backwards",
                code="RID-CELL-VALUE",
            )


def _check_stops(tree: YamlTree, cell: CellConfig, robot: RobotDescription) -> None:
    """Refuse decelerations far beyond the largest acceleration limit of the robot."""
    largest = max(joint.limits.acceleration for joint in robot.joints)
    key = "quick_stop_deceleration_rad_s2"
    stated: list[tuple[Path, float]] = [
        (("drive_safety", key), cell.drive_safety.quick_stop_deceleration_rad_s2)
    ]
    for number, axis in enumerate(cell.axes):
        if axis.quick_stop_deceleration_rad_s2 is not None:
            stated.append((("axes", number, key), axis.quick_stop_deceleration_rad_s2))
        own = cell.servo_of(axis).deceleration_rad_s2
        if own is not None:
            stated.append((("axes", number, "servo", "deceleration_rad_s2"), own))
    for path, value in stated:
        if value > STEEPEST_STOP * largest:
            raise ConfigError(
                f"{tree.where(path)}: {key_name(path)}: {value:g} is {value / largest:.3g} times"
                f" the robot's largest acceleration limit, {largest:g}; give at most"
                f" {STEEPEST_STOP:g} times this limit. Is the value in degrees/s²?",
                code="RID-CELL-VALUE",
            )
