"""`LinkPositions`: positions of links over time, from a file of encoders on the link side."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline

from acquisition.tracker.clock_offsets import (
    CODE,
    FEWEST_ROWS,
    InstrumentClock,
    clock_offsets,
    is_covered,
)
from acquisition.tracker.named_columns import read_named_columns
from acquisition.tracker.pose_file import joint_columns
from acquisition.tracker.tracker_file import read_times, read_valid
from config.arrays import FloatArray, freeze
from config.errors import ConfigError, DataQualityError
from config.robot.robot import RobotDescription

LARGEST_RESIDUAL: Final = 0.03
"""Largest RMS difference of link and motor that counts as the same motion [rad or m]."""
_ITERATIONS: Final = 15


@dataclass(frozen=True, eq=False)
class LinkPositions:
    """Positions of some links over time, on the clock of the instrument.

    Attributes:
        time_s: Shape (rows,). Time stamps of the instrument, increasing [s].
        joints: Indices of the m joints with an encoder on the link side.
        position: Shape (rows, m). Their positions; zero may be anywhere [rad or m].
    """

    time_s: FloatArray
    joints: tuple[int, ...]
    position: FloatArray

    def __post_init__(self) -> None:
        freeze(self, DataQualityError, (None,), "time_s")
        freeze(self, DataQualityError, (len(self.time_s), len(self.joints)), "position")

    def clock(self, time_s: FloatArray, position: FloatArray) -> InstrumentClock:
        """Return the clock with which the positions fit those of the motors in a run.

        Args:
            time_s: Shape (samples,). Times of the run, increasing [s].
            position: Shape (samples, n). Positions by the encoders at the motors.

        Raises:
            DataQualityError: The joints hardly move, the clock jumps, the two motions do not
                overlap in time, or they are not the same motion.
        """
        motors = CubicSpline(time_s, position[:, list(self.joints)])
        offsets = clock_offsets(self.time_s, self.position, time_s, motors(time_s))
        fits = [self._refined(motors, offset_s) for offset_s in offsets]
        residual, best = min(fits, key=lambda each: each[0], default=(np.inf, None))
        if best is None or residual > LARGEST_RESIDUAL:
            raise DataQualityError(
                "the positions of the links do not fit the run (residual"
                f" {residual:.3g} rad or m RMS): check that file and run belong together, and the"
                " signs and units of the columns",
                code=CODE,
            )
        return best

    def _refined(
        self, motors: CubicSpline, offset_s: float
    ) -> tuple[float, InstrumentClock | None]:
        """Return RMS residual and clock by Gauss-Newton steps; infinity without an overlap."""
        middle = float((self.time_s[0] + self.time_s[-1]) / 2.0)
        clock, velocity = InstrumentClock(offset_s, 0.0, middle), motors.derivative()
        residual = np.inf
        for _ in range(_ITERATIONS):
            at = clock.run_time(self.time_s)
            rows = is_covered(at, motors.x)
            if rows.sum() < FEWEST_ROWS:
                return np.inf, None
            speed = velocity(at[rows])
            speed -= speed.mean(axis=0)
            later = velocity(at[rows]) * (self.time_s[rows] - middle)[:, np.newaxis]
            later -= later.mean(axis=0)
            left = self.position[rows] - motors(at[rows])
            left -= left.mean(axis=0)  # the encoders' zeros
            residual = float(np.sqrt(np.mean(left**2)))
            columns = np.column_stack([-speed.ravel(), -later.ravel()])
            step = np.linalg.lstsq(columns, left.ravel(), rcond=None)[0]
            clock = InstrumentClock(
                clock.offset_s + float(step[0]), clock.rate + float(step[1]), middle
            )
            if abs(step[0]) < 1e-9:
                break
        return residual, clock


def read_link_positions(path: Path, robot: RobotDescription) -> LinkPositions:
    """Return the positions in a file of encoders on the link side.

    The file is a text table with the column `time_s` and, for each joint that has such an encoder,
    a column with the joint's name (rad or m) or with a unit (`axis1_deg`). A column `valid` (1 or
    0) is optional. Any sampling rate and gaps are permitted. Other columns are ignored.

    Raises:
        ConfigError: The file cannot be read, a column is missing, a row is not a number or out of
            range, or the time stamps do not increase; the message names the line.
    """
    columns = read_named_columns(path)
    columns = columns.keep(read_valid(columns))
    joints = tuple(
        number
        for number, joint in enumerate(robot.joints)
        if not set(joint_columns(joint)).isdisjoint(columns.names)
    )
    if not joints:
        raise ConfigError(
            f"{path}:{columns.header_row}: no column is named after a joint of robot"
            f" {robot.name!r}: name the columns {', '.join(robot.joint_names)}",
            code="RID-TRACKER-COLUMNS",
        )
    position = []
    for number in joints:
        joint = robot.joints[number]
        name, factor = columns.choose(joint_columns(joint), f"the position of joint {joint.name}")
        position.append(columns.numbers(name) * factor)
    return LinkPositions(read_times(columns), joints, np.column_stack(position))
