"""Checks of sound rows: reports oddities, and refuses recordings with grave contradictions.

Units, clock, gear ratios and zero positions are compared with the recorded velocities and with the
limits of the robot file. A torque that is constant while its joint moves is reported.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from acquisition.imports.causes import BEYOND_LIMIT, likely_cause_of_positions
from acquisition.imports.columns import ImportColumns, ImportRows
from acquisition.imports.torque_findings import (
    STANDSTILL,
    clipped_torque_findings,
    large_torque_findings,
    refuse_wrapped_torques,
    stuck_torque_findings,
)
from acquisition.maps.import_map import ImportMap
from acquisition.processing.smoothing import GAP_STEPS
from config.arrays import BoolArray, FloatArray
from config.column_file import each_column
from config.errors import DataQualityError
from config.robot.robot import Joint, RobotDescription

STANDSTILL_SPEED = 0.02
COMPARED_OVER_S = 0.1
RATIO_TOLERANCE = 0.03
ALIKE = 0.015
STUCK = 1e-4
SELDOM_S = 0.2
"""Longest step between rows without a finding [s]. With longer steps, rows show motion only below
about 2 Hz, but identification uses up to 10 Hz."""
JUMP_TIMES = 5.0
GLITCH_ROWS = 10
COMMAND_TIMES = 4.0
"""Largest plausible ratio of a joint's speed and its velocity command, or of their inverses."""
LEAST_COMMAND = 0.1
"""Smallest RMS speed at which a command is compared with the motion [rad/s or m/s]; friction can
hold a joint against smaller commands."""
_FACTORS = (
    (math.pi / 180.0, "degrees are read as radians"),
    (180.0 / math.pi, "radians are read as degrees"),
    (2.0 * math.pi, "radians are read as turns"),
    (0.5 / math.pi, "turns are read as radians"),
    (1e-3, "the unit of time, or of one of the two columns, is wrong by a factor of 1000"),
    (1e3, "the unit of time, or of one of the two columns, is wrong by a factor of 1000"),
    (1e-6, "the unit of time is wrong by a factor of a million"),
    (1e6, "the unit of time is wrong by a factor of a million"),
    (1e-9, "the unit of time is wrong by a factor of 1e9"),
    (1e9, "the unit of time is wrong by a factor of 1e9"),
)


class ContradictionError(DataQualityError):
    """Position and velocity of a joint contradict each other."""


@dataclass(frozen=True)
class Findings:
    """Results of the checks of sound rows.

    Attributes:
        sentences: One text for each oddity, with the remedy.
        velocity_ratio: For each joint, velocity from the positions divided by the velocity column;
            None if there is no such column, the joint is at rest, or the rows are too few.
        static: True if no joint moves.
    """

    sentences: tuple[str, ...]
    velocity_ratio: tuple[float | None, ...]
    static: bool


def check_rows(
    rows: ImportRows, columns: ImportColumns, import_map: ImportMap, robot: RobotDescription | None
) -> Findings:
    """Return the oddities of sound rows.

    Args:
        rows: Sound rows, at least 2.
        columns: Columns with which the rows were read.
        import_map: Map with which the rows were read.
        robot: Robot with the limits.

    Raises:
        DataQualityError: Positions contradict velocities or velocity commands, positions or speeds
            are far beyond the robot's limits, a zero position has moved, or a torque wraps.
    """
    ratios, sigmas = _velocity_ratios(rows, import_map)
    position = columns.joint_positions(rows.position)
    static = max(float(np.ptp(column)) for column in each_column(position)) < STANDSTILL
    sentences = [*_rate_findings(rows, import_map), *_velocity_findings(ratios, sigmas, import_map)]
    _refuse_other_commands(rows, import_map)
    refuse_wrapped_torques(rows, import_map)
    sentences += stuck_torque_findings(rows, import_map)
    sentences += clipped_torque_findings(rows, import_map)
    if robot is not None:
        sentences += _limit_findings(replace(rows, position=position), robot, import_map)
        _refuse_moved_zeros(rows.time_s, position, robot)
        sentences += large_torque_findings(rows.torque, robot)
    if static:
        sentences.append(
            "Static: no joint moves, so that the torques contain only gravity and nothing can be"
            " identified. Compare the recording with a model by `rid-daq validate MODEL RUN"
            " --standstill 0`. If the robot moved, the position columns are wrong"
        )
    return Findings(tuple(sentences), tuple(ratios), static)


def change_over_window(time_s: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Return a function that computes changes over 0.1 s, without intervals that contain a gap.

    Args:
        time_s: Shape (rows,). Times of the rows whose values the function takes.
    """
    steps = np.diff(time_s)
    step_s = float(np.median(steps))
    stride = min(max(1, round(COMPARED_OVER_S / step_s)), len(steps))
    gaps = np.concatenate([[0], np.cumsum(steps > GAP_STEPS * step_s)])
    near = gaps[stride:] == gaps[:-stride]

    def change(values: FloatArray) -> FloatArray:
        return np.asarray((values[stride:] - values[:-stride])[near])

    return change


def _velocity_ratios(
    rows: ImportRows, import_map: ImportMap
) -> tuple[list[float | None], list[float]]:
    """Return each joint's ratio of velocity from positions to recorded velocity, and its sigma.

    Over 0.1 s the position changes by the ratio times the integral of the velocity, plus the
    effects of a delay and an offset of the velocity.

    Raises:
        ContradictionError: Position and velocity of a joint contradict each other.
    """
    change = change_over_window(rows.time_s)
    time_s, steps = change(rows.time_s), np.diff(rows.time_s)
    overlapping = len(time_s) * float(np.median(time_s)) / max(float(np.ptp(rows.time_s)), 1e-9)
    ratios: list[float | None] = [None] * len(import_map.joints)
    sigmas = [0.0] * len(ratios)
    columns = zip(each_column(rows.position), each_column(rows.velocity), strict=True)
    for number, (joint, (position, speed)) in enumerate(
        zip(import_map.joints, columns, strict=True)
    ):
        if joint.velocity is None or len(time_s) < 10:
            continue
        a, b = change(position), change(_integral(speed, steps))
        moved, recorded = _rms(a / time_s), _rms(b / time_s)
        if max(moved, recorded) < STANDSTILL_SPEED:
            continue
        if _rms((a - b) / time_s) > 0.5 * max(moved, recorded):
            opposed = _rms((a + b) / time_s) < 0.1 * moved
            raise ContradictionError(
                f"the position of {joint.joint} (column {joint.position}) changes at a speed of"
                f" {moved:.3g}, but its velocity (column {joint.velocity}) is {recorded:.3g}"
                " (RMS, both in rad/s, or in m/s for a prismatic joint): the two contradict each"
                f" other{_obvious_contradiction(moved, recorded, opposed)}. Correct the columns or"
                " units in the map",
                code="RID-IMPORT-UNITS",
            )
        equations = np.column_stack([b, change(speed), time_s])
        solution = np.linalg.lstsq(equations, a, rcond=None)[0]
        ratios[number] = float(solution[0])
        left = float(np.square(a - equations @ solution).mean()) * max(overlapping, 1.0)
        spread = np.linalg.pinv(equations.T @ equations)[0, 0]
        sigmas[number] = math.sqrt(max(left * float(spread), 0.0))
    return ratios, sigmas


def _integral(speed: FloatArray, steps: FloatArray) -> FloatArray:
    return np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2.0 * steps)])


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.square(values).mean()))


def _refuse_other_commands(rows: ImportRows, import_map: ImportMap) -> None:
    """Refuse velocity commands that the motion contradicts.

    A velocity loop need not follow quick commands exactly, but over 0.1 s it moves in the direction
    of the command, and at a similar speed.

    Raises:
        ContradictionError: Position and velocity command of a joint contradict each other.
    """
    change = change_over_window(rows.time_s)
    time_s, steps = change(rows.time_s), np.diff(rows.time_s)
    columns = zip(each_column(rows.position), each_column(rows.command), strict=False)
    for joint, (position, command) in zip(import_map.joints, columns, strict=False):
        a, b = change(position) / time_s, change(_integral(command, steps)) / time_s
        moved, sent = _rms(a), _rms(b)
        if len(time_s) < 10 or max(moved, sent) < LEAST_COMMAND:
            continue
        opposed = 2.0 * _rms(a + b) < _rms(a - b)
        if opposed or max(moved, sent) > COMMAND_TIMES * min(moved, sent):
            raise ContradictionError(
                f"the position of {joint.joint} (column {joint.position}) changes at a speed of"
                f" {moved:.3g}, but its velocity command (column {joint.velocity_command}) is"
                f" {sent:.3g} (RMS, both in rad/s, or in m/s for a prismatic joint): the two"
                f" contradict each other{_obvious_contradiction(moved, sent, opposed)}. Correct"
                " the columns or units in the map",
                code="RID-IMPORT-UNITS",
            )


def _obvious_contradiction(moved: float, recorded: float, opposed: bool) -> str:
    """Return the obvious reason for a contradiction of position and velocity; empty if unknown."""
    if opposed:
        return " (their signs are opposite)"
    for factor, words in _FACTORS:
        if abs(recorded - factor * moved) < 0.05 * factor * moved:
            return f" ({words})"
    if moved < STUCK * recorded:
        return " (the position is stuck)"
    return " (the velocity is stuck)" if recorded < STUCK * moved else ""


def _rate_findings(rows: ImportRows, import_map: ImportMap) -> Iterator[str]:
    """Yield a finding if rows are more than `SELDOM_S` apart, too far to show accelerations."""
    step_s = float(np.median(np.diff(rows.time_s)))
    if step_s <= SELDOM_S:
        return
    finding = f"The rows are {step_s:.3g} s apart, too far to show accelerations and friction"
    if import_map.time is None:
        yield f"{finding}. Check rate_hz in the map"
        return
    finer = {"s": "ms", "ms": "us"}.get(import_map.time.unit)
    yield f"{finding}." + (
        f" If the stamps are {finer}, put `unit: {finer}` under `time` into the map"
        if finer
        else " Check the column of time in the map"
    )


def _velocity_findings(
    ratios: list[float | None], sigmas: list[float], import_map: ImportMap
) -> Iterator[str]:
    """Yield findings if recorded velocities and changes of positions differ by a factor."""
    known = {
        joint.joint: (ratio, RATIO_TOLERANCE + 2.0 * sigma)
        for joint, ratio, sigma in zip(import_map.joints, ratios, sigmas, strict=True)
        if ratio is not None
    }
    if not known:
        return
    common = float(np.median([ratio for ratio, _ in known.values()]))
    alike = all(
        abs(ratio / common - 1.0) <= ALIKE - RATIO_TOLERANCE + tolerance
        for ratio, tolerance in known.values()
    )
    beyond = any(abs(ratio - 1.0) > tolerance for ratio, tolerance in known.values())
    if len(known) > 1 and alike and beyond and abs(common - 1.0) > RATIO_TOLERANCE:
        key = "rate_hz" if import_map.rate_hz is not None else "time stamps"
        yield (
            f"The clock is wrong: velocities computed from positions and {key} are {common:.3f}"
            f" times the recorded velocities, in all joints. Multiply the times by {common:.4g},"
            " or find out whether times or velocities are right: with wrong times, inertial torques"
            " are wrong by the square of this factor"
        )
        return
    for name, (ratio, tolerance) in known.items():
        if abs(ratio - 1.0) > tolerance:
            yield (
                f"{name}: its position moves {ratio:.3f} times as fast as its velocity column:"
                " check unit, resolution and gear_ratio of position and velocity"
            )


def _refuse_moved_zeros(time_s: FloatArray, position: FloatArray, robot: RobotDescription) -> None:
    """Refuse a position that jumps at one row, far faster than its joint can move.

    Rows that the logger lost make all joints jump together; a lost zero concerns one joint.

    Raises:
        DataQualityError: The zero of a position has moved.
    """
    step_s = np.diff(time_s)
    np.maximum(step_s, float(np.median(step_s)), out=step_s)
    joints_that_jump = np.zeros(len(step_s), dtype=np.int64)
    jumps: list[tuple[Joint, FloatArray, BoolArray]] = []
    for joint, column in zip(robot.joints, each_column(position), strict=True):
        size = np.abs(np.diff(column))
        usual = float(np.percentile(size, 99.0))
        joints_that_jump += size > 2.0 * usual
        far = (size > JUMP_TIMES * joint.limits.velocity * step_s) & (size > JUMP_TIMES * usual)
        jumps.append((joint, column, far))
    for joint, column, far in jumps:
        for row in np.flatnonzero(far & (joints_that_jump == 1)).tolist():
            near = slice(max(row - GLITCH_ROWS, 0), row + GLITCH_ROWS + 1)
            steps = np.diff(column[near.start : near.stop + 1])
            moved, step = (
                float((steps * far[near]).sum()),
                abs(float(column[row + 1] - column[row])),
            )
            if abs(moved) < 0.5 * step:  # the position is wrong only in a few rows
                continue
            raise DataQualityError(
                f"the position of {joint.name} jumps by {step:.4g} {joint.unit} at"
                f" {time_s[row + 1]:.6g} s, which needs"
                f" {step / step_s[row] / joint.limits.velocity:.2g} times its velocity"
                " limit: its zero has moved, or its encoder lost counts. Leave out the rows before"
                " or after the jump (--rows)",
                code="RID-IMPORT-UNITS",
            )


def _limit_findings(
    rows: ImportRows, robot: RobotDescription, import_map: ImportMap
) -> Iterator[str]:
    """Yield findings for positions and speeds beyond the limits; refuse those far beyond."""
    change = change_over_window(rows.time_s)
    time_s = change(rows.time_s)
    columns = zip(robot.joints, each_column(rows.position), strict=True)
    for number, (joint, q) in enumerate(columns):
        limits = joint.limits
        low, high = float(q.min()), float(q.max())
        span = limits.position_max - limits.position_min
        beyond = max(limits.position_min - low, high - limits.position_max)
        speed = float(np.percentile(np.abs(change(q)) / time_s, 99.0))
        range_text = f"{joint.name} moves from {low:.4g} to {high:.4g} {joint.unit}"
        limit_text = (
            f"the robot file's limits are {limits.position_min:g} to {limits.position_max:g}"
            f" {joint.unit}"
        )
        if beyond > BEYOND_LIMIT * span:
            raise DataQualityError(
                f"{range_text}, but {limit_text}:"
                f" {likely_cause_of_positions(rows.position, robot, import_map, number)}",
                code="RID-IMPORT-UNITS",
            )
        if beyond > 0.0:
            yield f"{range_text}, but {limit_text}: check its zero_offset and unit, or the limits"
        if speed > 2.0 * limits.velocity:
            raise DataQualityError(
                f"{joint.name} moves at {speed:.4g} {joint.unit}/s, but the robot file's limit is"
                f" {limits.velocity:g} {joint.unit}/s: the unit of its position (degrees?) or of"
                " the time stamps, or the limit, is wrong; correct the map or the robot file",
                code="RID-IMPORT-UNITS",
            )
        if speed > 1.1 * limits.velocity:
            yield (
                f"{joint.name} moves at {speed:.4g} {joint.unit}/s, but the robot file's limit is"
                f" {limits.velocity:g} {joint.unit}/s: check units, clock and limit"
            )
