"""From which speed on joints move: what is slower tells nothing of their friction."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import BoolArray, FloatArray
from dynamics.model.robot_model import RobotModel

SLOW_SHARE: Final = 0.1
"""Share of a joint's speed limit from which on it moves, however slow that is."""


def standstill(model: RobotModel, speed_rad_s: float) -> FloatArray:
    """Return below which speed each actuator counts as standing, link side, (n,).

    The given speed [rad/s or m/s]; of a joint that is slow by nature, such as a lift, a tenth of
    its speed limit: it would never move otherwise.
    """
    given = np.full(len(model.joint_names), speed_rad_s)
    if not model.speed_limits:
        return given
    limits = np.array(model.speed_limits)
    if model.coupling is not None:
        limits = np.abs(model.coupling.motors_by_joints) @ limits
    return np.asarray(np.minimum(given, SLOW_SHARE * limits))


def moving(model: RobotModel, v: FloatArray, standstill_rad_s: float) -> BoolArray:
    """Return where actuators move fast enough for their friction to be known, (samples, n).

    Args:
        model: The robot.
        v: Shape (samples, n). The joints' velocities [rad/s or m/s].
        standstill_rad_s: Below this speed a joint stands; see `standstill`.
    """
    return np.asarray(np.abs(model.actuator_speed(v)) >= standstill(model, standstill_rad_s))


def moving_on(model: RobotModel, v: FloatArray, standstill_rad_s: float) -> BoolArray:
    """Return where actuators move and do not turn round before the next or after the last row.

    A slow recording may show no row of a quick reversal, at which friction jumps all the same.

    Args:
        model, v, standstill_rad_s: As for `moving`; consecutive rows.
    """
    moves = moving(model, v, standstill_rad_s)
    speed = model.actuator_speed(v)
    turns = speed[1:] * speed[:-1] < 0.0
    moves[1:] &= ~turns
    moves[:-1] &= ~turns
    return moves
