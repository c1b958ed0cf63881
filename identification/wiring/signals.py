"""`WiredSignals`: rows of all recordings, thinned, for the search of mistakes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import BoolArray, FloatArray, freeze
from config.column_file import each_column
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling

ROWS_PER_CYCLE: Final = 2.2
MOST_ROWS: Final = 1000
SCREEN_ROWS: Final = 150
MOVING_RAD_S: Final = 0.005


@dataclass(frozen=True, eq=False)
class WiredSignals:
    """Motion and torque of the motors, and the robot, as the user's files describe them.

    Attributes:
        position, velocity, acceleration: Shape (rows, n). The motors' motion on the link side,
            alpha of q = C alpha [rad or m, per s, per s^2].
        torque_nm: Shape (rows, n). The motors' torques [N m or N].
        moving: Shape (n,). Mask of the motors that move. The others are not used, because their
            friction is stiction.
    """

    robot: RobotDescription
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    torque_nm: FloatArray
    moving: BoolArray

    def __post_init__(self) -> None:
        shape = (len(self.position), len(self.robot.joints))
        freeze(self, EstimationError, shape, "position", "velocity", "acceleration", "torque_nm")

    @classmethod
    def of(cls, robot: RobotDescription, signals: Sequence[SmoothedSignals]) -> WiredSignals:
        """Combine recordings: two rows per cycle of the highest frequency, at most about 1000."""
        steps = [
            max(1, round(1.0 / (ROWS_PER_CYCLE * run.cutoff_hz * run.sample_period_s)))
            for run in signals
        ]
        rows = sum(len(run) / step for run, step in zip(signals, steps, strict=True))
        thinner = max(1, -(-int(rows) // MOST_ROWS))
        kept = [slice(None, None, step * thinner) for step in steps]
        coupling = WristCoupling.of_robot(robot)

        def together(name: str) -> FloatArray:
            thinned = [
                [column[rows].copy() for column in each_column(getattr(run, name))]
                for run, rows in zip(signals, kept, strict=True)
            ]
            values = np.concatenate([np.stack(columns, axis=1) for columns in thinned])
            moved = coupling is not None and name != "torque_nm"
            return coupling.to_motors(values) if coupling is not None and moved else values

        q, v, a = (together(name) for name in ("position", "velocity", "acceleration"))
        moving = np.sqrt(np.mean(np.square(v), axis=0)) >= MOVING_RAD_S
        return cls(robot, q, v, a, together("torque_nm"), moving)

    def thin(self) -> WiredSignals:
        """Return fewer rows, enough to find the mistakes that must be tried on all rows."""
        every = slice(None, None, max(1, len(self.position) // SCREEN_ROWS))
        names = ("position", "velocity", "acceleration", "torque_nm")
        q, v, a, torque_nm = (getattr(self, name)[every] for name in names)
        return WiredSignals(self.robot, q, v, a, torque_nm, self.moving)

    def joints(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return q, v and a of the joints, each (rows, n)."""
        motors = (self.position, self.velocity, self.acceleration)
        if self.robot.coupling is None:
            return motors
        across = np.array(self.robot.coupling).T
        q, v, a = (values @ across for values in motors)
        return q, v, a

    def transform(self, matrix: FloatArray, offset_rad: FloatArray, clock: float) -> WiredSignals:
        """Return signals with transformed positions and another clock.

        Args:
            matrix: Shape (n, n). Matrix from the stated to the new motor positions.
            offset_rad: Shape (n,). Offset added to the new positions [rad or m].
            clock: True seconds per second of the time stamps.
        """
        return replace(
            self,
            position=self.position @ matrix.T + offset_rad,
            velocity=self.velocity @ matrix.T / clock,
            acceleration=self.acceleration @ matrix.T / clock**2,
            moving=(matrix != 0.0) @ self.moving,
        )
