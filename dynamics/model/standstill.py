"""Speed above which a joint counts as moving; at rest, Coulomb friction is unknown."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import BoolArray, FloatArray
from dynamics.model.robot_model import RobotModel

SLOW_FRACTION: Final = 0.1
"""Fraction of a joint's speed limit; above this speed the joint always counts as moving."""


def standstill_speed(model: RobotModel, speed_rad_s: float) -> FloatArray:
    """Return the speed below which each actuator counts as at rest, link side, (n,).

    It is `speed_rad_s` [rad/s or m/s], but at most a tenth of the actuator's speed limit, if known.
    Otherwise a slow joint, such as a lift, might never count as moving.
    """
    given = np.full(len(model.joint_names), speed_rad_s)
    if not model.speed_limits:
        return given
    limits = np.array(model.speed_limits)
    if model.coupling is not None:
        limits = np.abs(model.coupling.motors_by_joints) @ limits
    return np.asarray(np.minimum(given, SLOW_FRACTION * limits))


def moving_actuators(model: RobotModel, v: FloatArray, standstill_rad_s: float) -> BoolArray:
    """Return True if an actuator moves fast enough for its friction to be known, (samples, n).

    Args:
        model: The robot.
        v: Shape (samples, n). The joints' velocities [rad/s or m/s].
        standstill_rad_s: Speed below which a joint counts as at rest; see `standstill_speed`.
    """
    return np.asarray(np.abs(model.actuator_speed(v)) >= standstill_speed(model, standstill_rad_s))


def moving_without_reversal(model: RobotModel, v: FloatArray, standstill_rad_s: float) -> BoolArray:
    """Return True if an actuator moves and does not reverse just before or after the row.

    The last row before a reversal and the first row after it are False, because friction jumps
    between them. In a recording with a low sampling rate, a quick reversal may occur between two
    rows, without any row at rest.

    Args:
        model, v, standstill_rad_s: As for `moving_actuators`; the rows must be consecutive.
    """
    moves = moving_actuators(model, v, standstill_rad_s)
    speed = model.actuator_speed(v)
    turns = speed[1:] * speed[:-1] < 0.0
    moves[1:] &= ~turns
    moves[:-1] &= ~turns
    return moves
