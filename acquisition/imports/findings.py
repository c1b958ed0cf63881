"""`findings`: what is odd about sound rows, and what is so odd that the recording is refused.

Units, clock, gear ratios and zero positions are held against the velocities recorded and the limits
of the robot file; a channel that stands still while its joint moves is named.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from acquisition.imports.causes import BEYOND_LIMIT, cause_of_positions
from acquisition.imports.columns import ImportColumns, ImportRows
from acquisition.imports.import_map import ImportMap
from acquisition.processing.smoothing import GAP_STEPS
from config.arrays import FloatArray
from config.errors import DataQualityError
from config.robot.robot import RobotDescription

STANDSTILL = 1e-3
STANDSTILL_SPEED = 0.02
COMPARED_OVER_S = 0.1
RATIO_TOLERANCE = 0.03
ALIKE = 0.015
STUCK = 1e-4
SELDOM_S = 0.2
"""Rows further apart show nothing of the 10 Hz that identification looks at, and hardly 2 Hz."""
STUCK_ROWS = 100
STUCK_SHARE = 0.2
_FACTORS = (
    (math.pi / 180.0, "degrees are read as radians"),
    (180.0 / math.pi, "radians are read as degrees"),
    (2.0 * math.pi, "radians are read as turns"),
    (0.5 / math.pi, "turns are read as radians"),
    (1e-3, "the unit of time, or of one of the two columns, is wrong by a thousand"),
    (1e3, "the unit of time, or of one of the two columns, is wrong by a thousand"),
)


@dataclass(frozen=True)
class Findings:
    """What was found.

    Attributes:
        sentences: What is odd, a sentence each, with what to do.
        velocity_ratio: Per joint, velocity from the positions over the velocity column; None where
            there is no such column or the joint stands still.
        static: Whether no joint moves.
    """

    sentences: tuple[str, ...]
    velocity_ratio: tuple[float | None, ...]
    static: bool


def find(
    rows: ImportRows, columns: ImportColumns, import_map: ImportMap, robot: RobotDescription | None
) -> Findings:
    """Look at sound rows.

    Args:
        rows: Sound rows, at least 2.
        columns: How they were read.
        robot: Its robot, for the limits.

    Raises:
        DataQualityError: Positions and velocities contradict one another, or positions or speeds
            are far beyond the robot's limits.
    """
    ratios, sigmas = _velocity_ratios(rows, import_map)
    position = columns.joint_positions(rows.position)
    static = bool(np.ptp(position, axis=0).max() < STANDSTILL)
    sentences = [*_seldom(rows, import_map), *_clock(ratios, sigmas, import_map)]
    sentences += _stuck(rows, import_map)
    if robot is not None:
        sentences += _limits(replace(rows, position=position), robot, import_map)
        sentences += _torques(rows.torque, robot)
    if static:
        sentences.append(
            "Static: no joint moves, so that gravity alone shows and nothing can be identified:"
            " compare it with a model by `rid-daq validate MODEL RUN --standstill 0`. If the robot"
            " moved, the position columns are wrong"
        )
    return Findings(tuple(sentences), tuple(ratios), static)


def differences(rows: ImportRows) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return what changes over a tenth of a second, where the stamps leave no gap.

    Returns:
        `time_s`, shape (pairs,). How long [s].
        `position, path, velocity`, shape (pairs, joints). Change of the positions, of the integral
            of the velocity columns, and of these.
    """
    steps = np.diff(rows.time_s)
    step_s = float(np.median(steps))
    stride = min(max(1, round(COMPARED_OVER_S / step_s)), len(steps))
    means = (rows.velocity[1:] + rows.velocity[:-1]) / 2.0
    path = np.vstack([np.zeros(rows.velocity.shape[1]), np.cumsum(means * steps[:, None], axis=0)])
    gaps = np.concatenate([[0], np.cumsum(steps > GAP_STEPS * step_s)])
    near = gaps[stride:] == gaps[:-stride]

    def change(values: FloatArray) -> FloatArray:
        return np.asarray((values[stride:] - values[:-stride])[near])

    return change(rows.time_s), change(rows.position), change(path), change(rows.velocity)


def _velocity_ratios(
    rows: ImportRows, import_map: ImportMap
) -> tuple[list[float | None], list[float]]:
    """Return velocity from positions over the velocity columns, and standard deviations.

    Where they contradict each other they are refused.

    Over a tenth of a second the position changes by r times the integral of the velocity, and by
    what a delay of the velocity or an offset of it makes: r is what is wanted.
    """
    time_s, position, path, velocity = differences(rows)
    overlapping = len(time_s) * float(np.median(time_s)) / max(float(np.ptp(rows.time_s)), 1e-9)
    ratios: list[float | None] = [None] * len(import_map.joints)
    sigmas = [0.0] * len(ratios)
    for number, joint in enumerate(import_map.joints):
        if joint.velocity is None or len(time_s) < 10:
            continue
        a, b = position[:, number], path[:, number]
        moved, said = (float(np.sqrt(np.square(x / time_s).mean())) for x in (a, b))
        if max(moved, said) < STANDSTILL_SPEED:
            continue
        if float(np.sqrt(np.square((a - b) / time_s).mean())) > 0.5 * max(moved, said):
            raise DataQualityError(
                f"the position of {joint.joint} (column {joint.position}) moves at"
                f" {moved:.3g} per second RMS, its velocity column {joint.velocity} says"
                f" {said:.3g}, and they do not go together{_likely(moved, said)}: correct the"
                " columns or units in the map",
                code="RID-IMPORT-UNITS",
            )
        equations = np.column_stack([b, velocity[:, number], time_s])
        solution = np.linalg.lstsq(equations, a, rcond=None)[0]
        ratios[number] = float(solution[0])
        left = float(np.square(a - equations @ solution).mean()) * max(overlapping, 1.0)
        spread = np.linalg.pinv(equations.T @ equations)[0, 0]
        sigmas[number] = math.sqrt(max(left * float(spread), 0.0))
    return ratios, sigmas


def _likely(moved: float, said: float) -> str:
    """Say what makes positions and velocities contradict each other, where that is plain."""
    if moved < STUCK * said:
        return " (the position is stuck)"
    if said < STUCK * moved:
        return " (the velocity is stuck)"
    close = [words for factor, words in _FACTORS if abs(said / moved / factor - 1.0) < 0.05]
    return f" ({close[0]})" if close else ""


def _seldom(rows: ImportRows, import_map: ImportMap) -> Iterator[str]:
    """Say where rows are so far apart that a robot's accelerations fall between them."""
    step_s = float(np.median(np.diff(rows.time_s)))
    if step_s <= SELDOM_S:
        return
    told = f"The rows are {step_s:.3g} s apart: accelerations and friction fall between them"
    if import_map.time is None:
        yield f"{told}. Check rate_hz in the map"
        return
    finer = {"s": "ms", "ms": "us"}.get(import_map.time.unit)
    yield f"{told}." + (
        f" If the stamps are {finer}, put `unit: {finer}` under `time` into the map"
        if finer
        else " Check the column of time in the map"
    )


def _clock(ratios: list[float | None], sigmas: list[float], import_map: ImportMap) -> Iterator[str]:
    """Say where velocities differ from positions by a factor: all alike, or one joint."""
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
            f"The clock is wrong: positions over {key} are {common:.3f} times the velocities"
            f" recorded, in all joints alike. Multiply the times by {common:.4g}, or find out"
            " which of the two is right: torques of acceleration are wrong by its square"
        )
        return
    for name, (ratio, tolerance) in known.items():
        if abs(ratio - 1.0) > tolerance:
            yield (
                f"{name}: its position moves {ratio:.3f} times as fast as its velocity column says:"
                " check the unit, resolution or gear_ratio of these two columns"
            )


def _stuck(rows: ImportRows, import_map: ImportMap) -> Iterator[str]:
    """Name torques that stay the same to the last digit while their joint moves."""
    for number, joint in enumerate(import_map.joints):
        torque, position = rows.torque[:, number], rows.position[:, number]
        travel = float(np.ptp(position))
        if travel < STANDSTILL:
            continue
        edges = np.flatnonzero(np.diff(torque) != 0.0) + 1
        starts, stops = np.array([0, *edges]), np.array([*edges, len(torque)])
        longest = int(np.argmax(stops - starts))
        first, last = int(starts[longest]), int(stops[longest]) - 1
        if last - first + 1 < STUCK_ROWS:
            continue
        moved = float(np.ptp(position[first : last + 1]))
        if moved > STUCK_SHARE * travel:
            column = joint.torque if joint.current is None else joint.current
            yield (
                f"{joint.joint}: its torque (column {column}) is stuck: it stays"
                f" {torque[first]:.4g} from row {rows.row[first]} to row {rows.row[last]} while the"
                f" joint moves by {moved:.3g}. Its parameters cannot be identified from there:"
                " correct the column, or cut these rows out"
            )


def _limits(rows: ImportRows, robot: RobotDescription, import_map: ImportMap) -> Iterator[str]:
    """Hold the joints' positions and speeds against the robot's limits."""
    time_s, moved, _, _ = differences(rows)
    speeds = np.percentile(np.abs(moved) / time_s[:, None], 99.0, axis=0)
    position = rows.position
    for number, joint in enumerate(robot.joints):
        limits, q = joint.limits, position[:, number]
        low, high = float(q.min()), float(q.max())
        span = limits.position_max - limits.position_min
        beyond = max(limits.position_min - low, high - limits.position_max)
        speed = float(speeds[number])
        goes = f"{joint.name} goes from {low:.4g} to {high:.4g}"
        may = f"the robot file's limits are {limits.position_min:g} to {limits.position_max:g}"
        if beyond > BEYOND_LIMIT * span:
            raise DataQualityError(
                f"{goes}; {may}: {cause_of_positions(position, robot, import_map, number)}",
                code="RID-IMPORT-UNITS",
            )
        if beyond > 0.0:
            yield f"{goes}; {may}: check its zero_offset and unit, or the limits"
        if speed > 2.0 * limits.velocity:
            raise DataQualityError(
                f"{joint.name} moves at {speed:.4g} per second, the robot file's limit is"
                f" {limits.velocity:g}: the unit of its position (degrees?), of the time stamps, or"
                " the limit is wrong; correct the map or the robot file",
                code="RID-IMPORT-UNITS",
            )
        if speed > 1.1 * limits.velocity:
            yield (
                f"{joint.name} moves at {speed:.4g} per second, the robot file's limit is"
                f" {limits.velocity:g}: check units, clock and limit"
            )


def _torques(torque: FloatArray, robot: RobotDescription) -> Iterator[str]:
    """Name torques that the robot cannot make."""
    for joint, values in zip(robot.joints, np.abs(torque).T, strict=True):
        most = float(np.percentile(values, 99.0))
        if most > 1.1 * joint.limits.torque:
            yield (
                f"{joint.name}: its torque reaches {most:.4g}, the robot file's limit is"
                f" {joint.limits.torque:g}: its torque constant or unit is probably too large by"
                f" {most / joint.limits.torque:.2g} or more"
            )
