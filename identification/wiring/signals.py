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

DELAYS_S: Final = (0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.08, 0.1, 0.12, 0.15, 0.2)
"""Delays of the torques, late and early, that are tried as mistakes."""
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
        shifted_nm: Shape (delays, rows, n). Torques recorded later by each of `tried_delays_s`; no
            delays if the time between rows is unknown.
    """

    robot: RobotDescription
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    torque_nm: FloatArray
    moving: BoolArray
    shifted_nm: FloatArray | None = None

    def __post_init__(self) -> None:
        shape = (len(self.position), len(self.robot.joints))
        freeze(self, EstimationError, shape, "position", "velocity", "acceleration", "torque_nm")

    @classmethod
    def of(cls, robot: RobotDescription, signals: Sequence[SmoothedSignals]) -> WiredSignals:
        """Combine recordings: two rows per cycle of the highest frequency, at most about 1000.

        Known delays of the torques are removed.
        """
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
            return values if coupling is None else coupling.to_motors(values)

        q, v, a = (together(name) for name in ("position", "velocity", "acceleration"))
        moving = np.sqrt(np.mean(np.square(v), axis=0)) >= MOVING_RAD_S
        delays_s = (0.0, *tried_delays_s())
        torques = [
            _torques_recorded_later(run, rows, delays_s)
            for run, rows in zip(signals, kept, strict=True)
        ]
        torque_nm, *shifted_nm = np.concatenate(torques, axis=1)
        return cls(robot, q, v, a, torque_nm, moving, np.stack(shifted_nm))

    def thin(self) -> WiredSignals:
        """Return fewer rows, enough to find the mistakes that must be tried on all rows."""
        every = slice(None, None, max(1, len(self.position) // SCREEN_ROWS))
        names = ("position", "velocity", "acceleration", "torque_nm")
        q, v, a, torque_nm = (getattr(self, name)[every] for name in names)
        shifted_nm = None if self.shifted_nm is None else self.shifted_nm[:, every]
        return WiredSignals(self.robot, q, v, a, torque_nm, self.moving, shifted_nm)

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

    def torque_recorded_later(self, delay_s: float, joints: Sequence[int]) -> FloatArray:
        """Return the torques (rows, n), those of some joints recorded later by a delay.

        Args:
            delay_s: One of `tried_delays_s`, or 0 [s].
            joints: The joints, from 0.
        """
        torque_nm = self.torque_nm.copy()
        if delay_s and self.shifted_nm is not None:
            shifted = self.shifted_nm[tried_delays_s().index(delay_s)]
            torque_nm[:, list(joints)] = shifted[:, list(joints)]
        return torque_nm


def tried_delays_s() -> tuple[float, ...]:
    """Return the delays of the torques that are tried, in rising order; negative if early [s]."""
    return (*(-delay_s for delay_s in reversed(DELAYS_S)), *DELAYS_S)


def _torques_recorded_later(
    run: SmoothedSignals, rows: slice, delays_s: Sequence[float]
) -> FloatArray:
    """Return the torques recorded later than some rows by each delay, (delays, rows, n).

    Known delays and first-order filters of the torques are added to each delay. Torques are
    interpolated; beyond the end of a segment, its last torque is used.
    """
    kept = np.arange(len(run))[rows]
    first = np.searchsorted(run.segment, run.segment[kept], side="left")
    last = np.searchsorted(run.segment, run.segment[kept], side="right") - 1
    known_s = np.zeros(len(run.joint_names))
    if run.channel is not None:
        known_s = run.channel.delay_s + run.channel.lag_s
    torques = []
    for column, own_s in zip(each_column(run.torque_nm), known_s.tolist(), strict=True):
        steps = (np.array(delays_s) + own_s) / run.sample_period_s
        later = np.clip(kept + steps[:, np.newaxis], first, last)
        before = later.astype(np.int64)
        after, share = np.minimum(before + 1, last), later - before
        torques.append((1.0 - share) * column[before] + share * column[after])
    return np.stack(torques, axis=2)
