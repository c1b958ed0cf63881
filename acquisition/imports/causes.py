"""Most likely mistakes in an import map, as text."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from acquisition.imports.columns import ImportColumns, ImportRows
from acquisition.imports.lines import states_no_number
from acquisition.imports.merged_topics import NO_NEIGHBOUR
from acquisition.imports.report import DamagedRow
from acquisition.maps.import_map import ImportMap
from acquisition.maps.time_column import match_date
from config.arrays import FloatArray
from config.robot.robot import JointLimits, RobotDescription

BEYOND_LIMIT = 0.05
"""Distance by which positions may exceed a joint's limits, as a fraction of the joint's range."""

_GROUPED = re.compile(r"['\"][-+]?\d{1,3}(\.\d{3})+,\d|['\"][-+]?\d{1,3}([,' ]\d{3})+\.\d")
"""A number with thousands separators and a decimal separator in a message."""

_OTHER_DATE = re.compile(r"['\"](\d\d?[/.-]\d\d?[/.-]\d{2,4},? )?\d\d?:\d\d:\d\d")
"""A time of day, or a date in an order that is not read, in a message."""

LARGEST_TURN_ERROR = 0.5
"""Largest difference between a jump of the position and a whole turn, by the motion [rad]."""

WITHIN_A_SECOND_S = 1.0
SHORTEST_STEP_S = 1e-6
MOST_STARTS = 10
START_STEPS = 10.0
"""Largest distance from the first time stamp of a stamp at which the time starts again [median time
steps]."""

_BY_REASON = {
    "with a wrong number of columns": "check columns, delimiter and header_rows of the map",
    "without a number": "check columns, decimal and header_rows of the map",
    NO_NEIGHBOUR: (
        "the topics were not recorded at the same time, or with gaps: choose the common part with"
        " --rows"
    ),
    "without a time stamp": "check column and unit of time, and header_rows, in the map",
    "with a repeated time stamp": (
        "the time stamps are too coarse for the rows: record finer ones, or replace time by"
        " rate_hz if the rate is known"
    ),
    "with a time stamp out of order": "check the column and unit of time in the map",
    "whose position jumps": (
        "a joint is faster than plausible.speed (raise this limit, or check the unit of position"
        " and time), or its encoder lost its zero (use only the rows before or after this: --rows)"
    ),
    "with a stuck position": (
        "the source repeated a joint's position while others changed: record again, or use only the"
        " rows before or after this (--rows)"
    ),
    "whose torque is missing": (
        "the source wrote a fixed number if it had no torque: record again, or raise"
        " left_out_limit if the remaining rows are enough"
    ),
}

_OF_MESSAGES = {
    "with a repeated time stamp": (
        "several programs publish this topic, or the time stamps in the headers of the messages are"
        " too coarse: record the arm's own topic, with complete time stamps"
    ),
    "with a time stamp out of order": (
        "the time stamps in the headers of the messages are not in order: record the arm's own"
        " topic, from one publisher"
    ),
}
_MESSAGES_LACK_VALUES = (
    "some messages lack positions or efforts of some joints: use only the messages that have them"
    " all, with --rows, or record the bag again"
)


def respects_position_limits(position: FloatArray, limits: Sequence[JointLimits]) -> bool:
    """Return True if positions, (rows, joints), exceed no limit by more than `BEYOND_LIMIT`.

    `BEYOND_LIMIT` is a fraction of the joint's range. The lowest and the highest 2 % of the
    positions are ignored. A joint without a finite position gives False.
    """
    if not np.isfinite(position).any(axis=0).all():
        return False
    low, high = np.nanpercentile(position, [2.0, 98.0], axis=0)
    room = [BEYOND_LIMIT * (limit.position_max - limit.position_min) for limit in limits]
    return all(
        limit.position_min - slack <= least and most <= limit.position_max + slack
        for limit, slack, least, most in zip(limits, room, low, high, strict=True)
    )


def likely_cause_of_positions(
    position: FloatArray, robot: RobotDescription, import_map: ImportMap, number: int
) -> str:
    """Return the most likely reason for positions beyond a joint's limits.

    Args:
        position: Shape (rows, joints). Joint positions as read [rad or m].
        robot: Robot with the limits.
        import_map: Map with which the positions were read.
        number: Index of the joint.
    """
    limits = [joint.limits for joint in robot.joints]
    gears = np.array([joint.gear_ratio for joint in robot.joints])
    joint, q = robot.joints[number].limits, position[:, number]
    low, high = np.nanpercentile(q, [0.0, 100.0])
    span, shift = joint.position_max - joint.position_min, (low + high) / 2.0
    shift -= (joint.position_max + joint.position_min) / 2.0
    if high - low <= span and abs(shift) <= 2.0 * math.pi:
        return (
            "its zero position probably differs from the robot file's: set zero_offset of"
            f" {robot.joint_names[number]} in the map ({shift:.2g} rad or m would centre the"
            " motion), or correct the limits"
        )
    likely = []
    if import_map.units.position == "rad" and respects_position_limits(
        position * (math.pi / 180.0), limits
    ):
        likely.append("in degrees: put `units: {position: deg}` into the map")
    if (
        import_map.side == "link"
        and np.abs(gears).max() > 1.0
        and respects_position_limits(position / gears, limits)
    ):
        likely.append("measured at the motors: put `side: motor` into the map")
    if likely:
        return f"the positions are probably {', or '.join(likely)}"
    return (
        "the unit, gear ratio or column of the position is wrong, or the limits are wrong: correct"
        " the map or the robot file"
    )


def likely_cause_of_damage(
    rows: ImportRows,
    damaged: Sequence[DamagedRow],
    columns: ImportColumns,
    import_map: ImportMap,
    robot: RobotDescription | None,
) -> str:
    """Return the most likely reason why too few rows are sound, with the remedy.

    Args:
        rows: All rows that contain numbers.
        damaged: The rows that were left out.
        columns: Columns with which the rows were read.
        import_map: Map with which the rows were read.
        robot: Robot with limits and gear ratios.
    """
    if not damaged:
        return "record more"
    ((reason, _),) = Counter(row.reason for row in damaged).most_common(1)
    if import_map.joint_states is not None:
        is_missing = reason == NO_NEIGHBOUR or _is_value_missing(damaged[-1].detail)
        cause = _MESSAGES_LACK_VALUES if is_missing else _OF_MESSAGES.get(reason)
        if cause is not None and not _starts_again(rows):
            return cause
    if reason == "without a number" and _GROUPED.search(damaged[-1].detail):
        return "the numbers have thousands separators: export the file without them"
    if reason == "without a number" and _has_decimal_commas(damaged, import_map):
        return "the numbers have a decimal comma: put `decimal: ','` into the map"
    if reason == "without a time stamp" and _has_dates(damaged):
        return "the time stamps are dates: put `unit: iso` into `time` of the map"
    if reason == "without a time stamp" and _OTHER_DATE.search(damaged[-1].detail):
        return (
            "the time stamps are times of day, or dates in an order that is not read: write dates"
            " such as 2026-11-26T08:00:00.123 and put `unit: iso` into `time` of the map, or write"
            " seconds"
        )
    if _is_value_missing(damaged[-1].detail):
        return (
            "values are missing (empty cells, or texts such as nan): if several topics were"
            " exported into one file, put `empty_cells: interpolate` into the map; if not, correct"
            " its columns"
        )
    in_ns = import_map.time is not None and import_map.time.unit == "ns"
    if in_ns and _covers_less_than(rows.time_s, WITHIN_A_SECOND_S):
        if reason == "with a time stamp out of order":
            return (
                "the time stamps are nanoseconds within a second: give the column of the seconds"
                " too, such as `time: {column: 0, nanoseconds: 1}`"
            )
        if _covers_less_than(rows.time_s, SHORTEST_STEP_S * len(rows.time_s)):
            return "the unit of time is not ns: correct it in the map"
    if reason == "with a time stamp out of order" and (starts := _starts_again(rows)):
        return (
            f"the time starts again in row {', '.join(map(str, starts))}: import each part alone,"
            " with --rows"
        )
    if reason == "with a repeated time stamp" and _are_whole_seconds(rows.time_s, import_map):
        return (
            "the time stamps are whole seconds: if another column has their nanoseconds, give its"
            " number as `nanoseconds`: `time: {column: 0, nanoseconds: 1}`"
        )
    wrapped = _wrapped_joint(rows, import_map) if reason == "whose position jumps" else None
    if wrapped is not None:
        return (
            f"the positions of {wrapped} jump by whole turns, like angles that are limited to one"
            " turn: make them continuous before the import, for example by numpy.unwrap"
        )
    if reason != "with an absurd value":
        return _BY_REASON.get(
            reason, "the clocks of the files start at different times, or a unit of time is wrong"
        )
    plausible = import_map.plausible
    position, torque = np.abs(rows.position), np.abs(rows.torque)
    with np.errstate(invalid="ignore"):
        far, strong = position > plausible.position, torque > plausible.torque
    if robot is not None and far.any(axis=1).sum() > strong.any(axis=1).sum():
        number = int(np.argmax(far.sum(axis=0)))
        joints = columns.joint_positions(rows.position)
        cause = likely_cause_of_positions(joints, robot, import_map, number)
        return f"{robot.joint_names[number]}: {cause}"
    if robot is not None and strong.any():
        number = int(np.argmax(strong.sum(axis=0)))
        most = float(np.nanpercentile(torque[:, number], 99.0))
        joint = robot.joints[number]
        return (
            f"torques of {joint.name} reach {most:.4g}, but the robot file's limit is"
            f" {joint.limits.torque:g}: its torque constant or unit is probably too large"
        )
    return "check columns, units and `plausible` in the map"


def _wrapped_joint(rows: ImportRows, import_map: ImportMap) -> str | None:
    """Return the joint whose position has jumps, all of them by a whole turn; None without one."""
    steps = np.abs(np.diff(rows.position, axis=0))
    for name, step in zip(import_map.joint_names, steps.T, strict=True):
        jumps = step[step > math.pi]
        if jumps.size and (np.abs(jumps - 2.0 * math.pi) < LARGEST_TURN_ERROR).all():
            return name
    return None


def _has_decimal_commas(damaged: Sequence[DamagedRow], import_map: ImportMap) -> bool:
    """Return True if a field of the last damaged row is a number with a decimal comma."""
    last = damaged[-1].detail
    return import_map.decimal == "." and bool(re.search(r"'[-+]?\d+,\d+(e[-+]?\d+)?' \(", last))


def _is_value_missing(detail: str) -> bool:
    """Return True if the detail of a damaged row names an empty cell, or a missing value."""
    quoted = re.search(r" is '([^']*)' \(", detail)
    of_text = quoted is not None and states_no_number(quoted[1])
    return of_text or " is empty (" in detail or " is nan, " in detail


def _has_dates(damaged: Sequence[DamagedRow]) -> bool:
    """Return True if the time stamp of the last damaged row is a date."""
    return any(match_date(text) for text in damaged[-1].detail.split("'"))


def _starts_again(rows: ImportRows) -> list[int]:
    """Return the rows in which the time starts again; none if it goes back for another reason."""
    back = np.flatnonzero(np.diff(rows.time_s) < 0.0) + 1
    if not 0 < len(back) <= MOST_STARTS:
        return []
    first, step_s = rows.time_s[0], float(np.median(np.diff(rows.time_s)))
    near = rows.time_s[back] <= first + START_STEPS * step_s
    return [int(row) for row in rows.row[back]] if near.all() else []


def _covers_less_than(time_s: FloatArray, span_s: float) -> bool:
    """Return True if the first and the last of all time stamps are less than `span_s` apart."""
    return len(time_s) > 0 and float(np.ptp(time_s)) < span_s


def _are_whole_seconds(time_s: FloatArray, import_map: ImportMap) -> bool:
    """Return True if the stamps are in seconds and have no fraction."""
    in_seconds = import_map.time is not None and import_map.time.unit == "s"
    return in_seconds and bool((time_s == np.round(time_s)).all())
