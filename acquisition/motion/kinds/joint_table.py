"""Joint positions over time, in the motion file or in a planner's file next to it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field, ValidationError, model_validator

from acquisition.motion.kinds.motion import LONGEST_MOTION_S, Motion, refuse_longer
from acquisition.motion.paths.timed_curve import (
    FEWEST_ROWS,
    TimedCurve,
    curve_through_positions,
    curve_through_velocities,
)
from acquisition.motion.samples import JointTrajectory, MotionSamples, with_rests
from acquisition.motion.trajectory_file import VELOCITIES, read_trajectory
from config.arrays import BoolArray, FloatArray
from config.errors import ConfigError, LimitError
from config.load import to_yaml
from config.plausible import Derived, Plausible, implausible, key_name
from config.robot.robot import RobotDescription
from config.wrong_value import explain_error

AT_REST: Final = 0.02
MOST_FACTOR: Final = 5.0
"""Largest accepted ratio between the velocities of a table and the rates of its positions."""
STILL: Final = 1e-3
"""Fraction of a joint's velocity limit up to which the velocities of a table count as zero."""
SLOWEST: Final = (1e-5, 1e-3)
"""Range of a table's largest speed, as a fraction of the velocity limit, that suggests times in ms:
with times in s, the table would reach 0.01 to 1 times the limit. A table at rest is slower
still."""
STOPPING: Final = 5.77
"""Largest acceleration of a quintic from rest to rest, divided by distance / time^2."""
POSITIONS: Final = Plausible(0.0, 50.0, "rad or m")
SPEEDS: Final = Plausible(0.0, 60.0, "rad/s or m/s")
TIMES: Final = Plausible(0.01, LONGEST_MOTION_S, "s")


class JointTableMotion(Motion, Derived):
    """Joint positions over time, from a planner's file, or in the motion file itself.

    A smooth curve passes through the rows: of class C4 through positions alone, of class C3 through
    positions and velocities. The motion must begin and end at rest. A row that repeats the previous
    one is left out.

    Attributes:
        file: File next to the motion file. A CSV file has a column `time_s` or `time_from_start`
            [s] and one column per joint, with the joint's name [rad or m]; velocities are in
            columns such as `axis1_velocity` or `vel_axis1`; accelerations are not used. Columns are
            separated by commas, semicolons, tabs or spaces; decimal commas and UTF-16 are read too.
            A JSON or YAML file contains a `trajectory_msgs/JointTrajectory` as ROS and MoveIt write
            it.
        joints: Without `file`: names of the joints, in the order of the columns of `position`.
        time_s: Without `file`: time of each row [s].
        position: Without `file`: rows of joint positions [rad or m].
        velocity: Without `file`: rows of joint velocities [rad/s or m/s]; without velocities, the
            positions alone define the curve.
        dwell_s: Rest before and after the motion [s].
    """

    kind: Literal["joint_table"]
    file: str | None = None
    joints: tuple[str, ...] = ()
    time_s: tuple[float, ...] = Field(default=(), max_length=1_000_000)
    position: tuple[tuple[float, ...], ...] = Field(default=(), max_length=1_000_000)
    velocity: tuple[tuple[float, ...], ...] = Field(default=(), max_length=1_000_000)
    dwell_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.2

    @model_validator(mode="after")
    def _check_source(self) -> JointTableMotion:
        if (self.file is None) == (not self.time_s):
            raise ValueError("give either `file`, or `joints`, `time_s` and `position`")
        if len(self.time_s) != len(self.position):
            raise ValueError(
                f"time_s has {len(self.time_s)} rows, position {len(self.position)}: give the"
                " same number"
            )
        if self.velocity and len(self.velocity) != len(self.time_s):
            raise ValueError(
                f"time_s has {len(self.time_s)} rows, velocity {len(self.velocity)}: give the"
                " same number, or no velocity"
            )
        for key, rows in (("position", self.position), ("velocity", self.velocity)):
            for number, row in enumerate(rows, start=1):
                if len(row) != len(self.joints):
                    raise ValueError(
                        f"row {number} of {key} has {len(row)} values for {len(self.joints)} joints"
                    )
        return self

    def derived(self) -> dict[str, tuple[float, Plausible]]:
        """Return the table's largest position and velocity, and its duration; 0 before reading."""
        furthest = max((abs(value) for row in self.position for value in row), default=0.0)
        fastest = max((abs(value) for row in self.velocity for value in row), default=0.0)
        lasts_s = max(self.time_s) - min(self.time_s) if self.time_s else 0.0
        return {
            "position": (furthest, POSITIONS),
            "velocity": (fastest, SPEEDS),
            "time_s": (lasts_s, TIMES),
        }

    @property
    def read_later(self) -> frozenset[str]:
        """Keys whose values are read later, from the trajectory file; empty without a file."""
        return (
            frozenset({"position", "velocity", "time_s"}) if self.file is not None else frozenset()
        )

    def describe(self) -> str:
        """Return a description of the motion in one sentence."""
        return f"A table of {len(self.time_s)} rows of joint positions."

    def next_command(self, run: Path) -> tuple[object, ...]:
        """Return the command that evaluates the path error of a run."""
        return "tracking", run

    def to_keep(self, written: bytes) -> bytes:
        """Return the motion file with the rows of the trajectory file in it."""
        return to_yaml(self).encode()

    def with_file_data(self, folder: Path) -> JointTableMotion:
        """Return the motion with the rows of its trajectory file.

        Args:
            folder: Folder of the motion file, which contains the trajectory file.

        Raises:
            ConfigError: The file cannot be read, or one of its rows is invalid; the text names it.
        """
        if self.file is None:
            return self
        path = folder / Path(self.file).expanduser()
        rows = read_trajectory(path)
        try:
            whole = JointTableMotion.from_attributes(
                self,
                file=None,
                joints=rows.joints,
                time_s=rows.time_s,
                position=rows.position,
                velocity=rows.velocity,
            )
        except ValidationError as error:
            raise ConfigError(
                f"{path}: {explain_error(error.errors()[0])}", code="RID-FILE-VALUE"
            ) from None
        found = [f"{path}: {key_name(key)}: {words}" for key, words in implausible(whole)]
        if found:
            raise ConfigError("\n".join(found), code="RID-TABLE-INVALID")
        return whole

    def _samples(self, robot: RobotDescription, sample_period_s: float) -> MotionSamples:
        refuse_longer(
            max(self.time_s) - min(self.time_s), "from the first to the last time of its table"
        )
        if sorted(self.joints) != sorted(robot.joint_names):
            raise ConfigError(
                f"the table has columns for {', '.join(self.joints) or 'no joint'}, but robot"
                f" {robot.name!r} needs each of {', '.join(robot.joint_names)} once",
                code="RID-MOTION-JOINTS",
            )
        order = [self.joints.index(name) for name in robot.joint_names]
        time_s, position = np.array(self.time_s), np.array(self.position)[:, order]
        velocity = np.array(self.velocity)[:, order] if self.velocity else None
        curve = _curve(time_s, position, velocity, robot)
        rows = math.ceil((time_s[-1] - time_s[0]) / sample_period_s - 1e-9)
        at_s = np.minimum(time_s[0] + np.arange(rows + 1) * sample_period_s, time_s[-1])
        path = JointTrajectory(*(np.asarray(curve(at_s, order)) for order in range(3)))
        return with_rests(path, self.dwell_s, robot.joint_names, sample_period_s)


def _curve(
    time_s: FloatArray, position: FloatArray, velocity: FloatArray | None, robot: RobotDescription
) -> TimedCurve:
    """Return the curve through the rows of a table.

    Raises:
        ConfigError: Times do not increase or are in ms, positions exceed the limits, an end is not
            at rest, or velocities contradict the positions.
    """
    rows = [position] if velocity is None else [position, velocity]
    values = np.hstack([time_s[:, np.newaxis], *rows])
    kept = np.concatenate([[True], (np.diff(values, axis=0) != 0.0).any(axis=1)])
    _check_times(time_s, kept)
    _check_positions(position, robot)
    time_s, position = time_s[kept], position[kept]
    _check_unit_of_time(time_s, position, robot)
    fewest = FEWEST_ROWS if velocity is None else 2
    if len(time_s) < fewest:
        raise ConfigError(
            f"the table has {len(time_s)} different rows, but at least {fewest} are needed: add"
            " rows",
            code="RID-TABLE-INVALID",
        )
    if velocity is None:
        begin, end = (
            _end_speeds(time_s[way], position[way]) for way in (slice(4), slice(-1, -5, -1))
        )
        _check_rest(begin, end, len(kept), robot)
        return curve_through_positions(time_s, position)
    velocity = velocity[kept]
    _check_rest(np.abs(velocity[0]), np.abs(velocity[-1]), len(kept), robot)
    _check_velocities(time_s, position, velocity, robot)
    return curve_through_velocities(time_s, position, velocity)


def _check_times(time_s: FloatArray, kept: BoolArray) -> None:
    """Check that the times increase from row to row; repeated rows are ignored."""
    late = kept[1:] & (np.diff(time_s) <= 0.0)
    if late.any():
        row = int(np.argmax(late)) + 2
        raise ConfigError(
            f"row {row} of the table is at {time_s[row - 1]:g} s, not later than the previous"
            " row: its time must increase",
            code="RID-TABLE-INVALID",
        )


def _check_unit_of_time(time_s: FloatArray, position: FloatArray, robot: RobotDescription) -> None:
    """Check that the table is not so slow that its times must be in milliseconds."""
    if len(time_s) < 2:
        return
    limits = np.array([joint.limits.velocity for joint in robot.joints])
    speed = np.abs(np.diff(position, axis=0)) / np.diff(time_s)[:, np.newaxis]
    share = float((speed / limits).max())
    if SLOWEST[0] <= share <= SLOWEST[1]:
        raise ConfigError(
            f"the table lasts {time_s[-1] - time_s[0]:g} s, and its fastest joint reaches only"
            f" {100.0 * share:.2g} % of its velocity limit; with times in ms it would be"
            f" {1e5 * share:.2g} %: give the times in s (for slower motions use `kind:"
            " constant_velocity`)",
            code="RID-TABLE-INVALID",
        )


def _check_positions(position: FloatArray, robot: RobotDescription) -> None:
    """Check that all positions are within the joints' limits."""
    for j, joint in enumerate(robot.joints):
        low, high = joint.limits.position_min, joint.limits.position_max
        off = (position[:, j] < low) | (position[:, j] > high)
        if off.any():
            row = int(np.argmax(off))
            at, unit = float(position[row, j]), joint.unit
            likely = Plausible(0.0, max(abs(low), abs(high)), unit).likely_unit(abs(at))
            raise LimitError(
                f"row {row + 1} of the table has joint {joint.name!r} at {at:.4g} {unit},"
                f" outside its limits {low:g} to {high:g} {unit}{likely}",
                code="RID-MOTION-LIMIT",
            )


def _end_speeds(time_s: FloatArray, position: FloatArray) -> FloatArray:
    """Return the speeds at one end of a table, shape (n,), by the most favourable polynomial.

    Polynomials of degree 1, 2 and 3 pass through the first two, three and four rows; the lowest
    speed is returned. For a motion from rest with constant acceleration, the straight line is not
    at rest at the end, but the parabola is.

    Args:
        time_s: Shape (4,). Times from the end inwards [s].
        position: Shape (4, n). Positions at these times.
    """
    since_s = time_s - time_s[0]
    speeds = [
        np.abs(np.polyfit(since_s[: degree + 1], position[: degree + 1], degree)[-2])
        for degree in (1, 2, 3)
    ]
    return np.asarray(np.min(speeds, axis=0))


def _check_rest(begin: FloatArray, end: FloatArray, rows: int, robot: RobotDescription) -> None:
    """Check that the speeds at both ends are small enough for a motion from rest to rest."""
    for j, joint in enumerate(robot.joints):
        for row, speed in ((1, begin[j]), (rows, end[j])):
            if speed > AT_REST * joint.limits.velocity:
                raise ConfigError(
                    f"in row {row} of the table joint {joint.name!r} moves at {speed:.3g} per"
                    " second, but the table must begin and end at rest: add rows that accelerate"
                    " from rest and brake to rest",
                    code="RID-TABLE-INVALID",
                )


def _check_velocities(
    time_s: FloatArray, position: FloatArray, velocity: FloatArray, robot: RobotDescription
) -> None:
    """Check that unit and sign of the velocities match the changes of the positions."""
    step_s = np.diff(time_s)[:, np.newaxis]
    change = np.diff(position, axis=0) / step_s
    mean = 0.5 * (velocity[1:] + velocity[:-1])
    stops = (STOPPING * np.abs(change) / step_s).max(axis=0)
    for j, joint in enumerate(robot.joints):
        columns = " or ".join(form.format(joint.name) for form in VELOCITIES)
        remedy = f"correct the velocities (in a CSV file the column {columns}), or leave them out"
        is_still = np.abs(mean[:, j]).max() <= STILL * joint.limits.velocity
        if is_still and stops[j] > joint.limits.acceleration:
            raise ConfigError(
                f"the velocities of joint {joint.name!r} are zero in each row of the table, but its"
                f" positions change faster than it can stop in each row: {remedy}",
                code="RID-TABLE-INVALID",
            )
        if len(time_s) < FEWEST_ROWS or is_still:
            continue
        factor = float(np.sum(mean[:, j] * change[:, j]) / np.sum(mean[:, j] ** 2))
        if not 1.0 / MOST_FACTOR <= factor <= MOST_FACTOR:
            raise ConfigError(
                f"the positions of joint {joint.name!r} change by {factor:.3g} times its velocities"
                f" in the table: {remedy}",
                code="RID-TABLE-INVALID",
            )
