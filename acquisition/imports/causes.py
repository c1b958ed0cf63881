"""`cause_of_positions`, `cause_of_loss`: what is probably wrong with a map, in words."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from acquisition.imports.columns import ImportColumns, ImportRows
from acquisition.imports.import_map import ImportMap
from acquisition.imports.report import DamagedRow
from config.arrays import FloatArray
from config.robot.robot import JointLimits, RobotDescription

BEYOND_LIMIT = 0.05
"""By which share of its range a joint may leave its limits."""

_BY_REASON = {
    "with a wrong number of columns": "check columns, delimiter and header_rows of the map",
    "without a number": "check columns, decimal and header_rows of the map",
    "with a doubled time stamp": (
        "the time stamps are coarser than the rows: record finer ones, or give rate_hz in place of"
        " time if the rate is known"
    ),
    "with a time stamp out of order": "check the column and unit of time in the map",
    "whose position jumps": (
        "a joint is faster than plausible.speed allows (raise it, or check the unit of position and"
        " time), or its encoder lost its zero (cut the rows before or after out with --rows)"
    ),
}


def within(position: FloatArray, limits: Sequence[JointLimits]) -> bool:
    """Return whether positions, shape (rows, joints), keep limits, but for a few rows."""
    if not np.isfinite(position).any(axis=0).all():
        return False
    low, high = np.nanpercentile(position, [2.0, 98.0], axis=0)
    room = [BEYOND_LIMIT * (limit.position_max - limit.position_min) for limit in limits]
    return all(
        limit.position_min - slack <= least and most <= limit.position_max + slack
        for limit, slack, least, most in zip(limits, room, low, high, strict=True)
    )


def cause_of_positions(
    position: FloatArray, robot: RobotDescription, import_map: ImportMap, number: int
) -> str:
    """Say what probably makes positions leave a joint's limits.

    Args:
        position: Shape (rows, joints). The joints' positions, as read [rad or m].
        robot: Its limits.
        import_map: How they were read.
        number: The joint, from 0.
    """
    limits = [joint.limits for joint in robot.joints]
    gears = np.array([joint.gear_ratio for joint in robot.joints])
    joint, q = robot.joints[number].limits, position[:, number]
    low, high = np.nanpercentile(q, [0.0, 100.0])
    span, shift = joint.position_max - joint.position_min, (low + high) / 2.0
    shift -= (joint.position_max + joint.position_min) / 2.0
    if high - low <= span and abs(shift) <= 2.0 * math.pi:
        return (
            f"its zero is probably elsewhere: give {robot.joint_names[number]} its zero_offset in"
            f" the map ({shift:.2g} rad or m would put the motion in the middle), or correct the"
            " limits"
        )
    likely = []
    if import_map.units.position == "rad" and within(position * (math.pi / 180.0), limits):
        likely.append("degrees: put `units: {position: deg}` into the map")
    if import_map.side == "link" and np.abs(gears).max() > 1.0 and within(position / gears, limits):
        likely.append("the motors': put `side: motor` into the map")
    if likely:
        return f"the positions are probably {', or '.join(likely)}"
    return "its unit, gear or column is wrong, or the limits are: correct the map or the robot file"


def cause_of_loss(
    rows: ImportRows,
    damaged: Sequence[DamagedRow],
    columns: ImportColumns,
    import_map: ImportMap,
    robot: RobotDescription | None,
) -> str:
    """Say what probably makes many rows damaged.

    Args:
        rows: All rows that are numbers.
        damaged: The rows left out.
        columns: How they were read.
        robot: Its robot, for limits and gears.
    """
    if not damaged:
        return "record more"
    ((reason, _),) = Counter(row.reason for row in damaged).most_common(1)
    if reason == "without a number" and _decimal_commas(damaged, import_map):
        return "its numbers have a decimal comma: put `decimal: ','` into the map"
    if reason != "with an absurd value":
        return _BY_REASON.get(
            reason, "the files' clocks start at different times, or a unit of time is wrong"
        )
    plausible = import_map.plausible
    position, torque = np.abs(rows.position), np.abs(rows.torque)
    with np.errstate(invalid="ignore"):
        far, strong = position > plausible.position, torque > plausible.torque
    if robot is not None and far.any(axis=1).sum() > strong.any(axis=1).sum():
        number = int(np.argmax(far.sum(axis=0)))
        joints = columns.joint_positions(rows.position)
        return (
            f"{robot.joint_names[number]}: {cause_of_positions(joints, robot, import_map, number)}"
        )
    if robot is not None and strong.any():
        number = int(np.argmax(strong.sum(axis=0)))
        most = float(np.nanpercentile(torque[:, number], 99.0))
        joint = robot.joints[number]
        return (
            f"torques of {joint.name} reach {most:.4g}, the robot file's limit is"
            f" {joint.limits.torque:g}: its torque constant or unit is probably too large"
        )
    return "check columns and units of the map, and what it calls plausible"


def _decimal_commas(damaged: Sequence[DamagedRow], import_map: ImportMap) -> bool:
    """Return whether what is no number of the last row would be one with a decimal comma."""
    last = damaged[-1].detail
    return import_map.decimal == "." and bool(re.search(r"'[-+]?\d+,\d+(e[-+]?\d+)?'$", last))
