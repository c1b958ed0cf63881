"""`keeps_limits`: whether a robot can have moved, and driven, as a mistake undone says."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.wiring.mistakes import Mistake
from identification.wiring.signals import WiredSignals

BEYOND: Final = 1.2
BEYOND_TRAVEL: Final = 0.05
LEAST_MOTION: Final = 0.01
LEAST_TORQUE: Final = 0.003


def keeps_limits(mistake: Mistake, stated: WiredSignals, undone: WiredSignals) -> bool:
    """Return whether undoing a mistake leaves motion and torques that the joints can have.

    None may go beyond a limit of the robot file that was kept, or farther beyond it; what kept its
    limits must not shrink to nothing.

    Args:
        mistake: What is undone.
        stated, undone: With the mistake, and without it.
    """
    limits = [joint.limits for joint in stated.robot.joints]
    torque = np.array([limit.torque for limit in limits])
    if mistake.changes_torque and not _possible(
        np.abs(stated.torque_nm).max(axis=0) / torque,
        np.abs(undone.torque_nm).max(axis=0) / torque,
        LEAST_TORQUE,
    ):
        return False
    if not mistake.moves:
        return True
    (q, v, _), (right_q, right_v, _) = stated.joints(), undone.joints()
    speed = np.array([limit.velocity for limit in limits])
    before, after = np.abs(v).max(axis=0) / speed, np.abs(right_v).max(axis=0) / speed
    outside = _outside(stated.robot, q)
    over = np.maximum(before, np.where(outside > BEYOND_TRAVEL, np.inf, 0.0))
    if not _possible(before, after, LEAST_MOTION, over):
        return False
    right_outside = _outside(stated.robot, right_q)
    return bool(np.all((right_outside <= BEYOND_TRAVEL) | (right_outside <= outside + 1e-9)))


def _possible(
    before: FloatArray, after: FloatArray, least: float, over: FloatArray | None = None
) -> bool:
    """Return whether shares of limits, (n,), are possible after a mistake is undone.

    `over` says how far beyond limits they were before, if more than these shares tell it.
    """
    beyond = before if over is None else over
    too_much = (after > BEYOND) & (after > before * (1.0 + 1e-9))
    too_little = (after < least) & (after < before * (1.0 - 1e-9)) & (beyond <= BEYOND)
    return not bool(np.any(too_much | too_little))


def _outside(robot: RobotDescription, q: FloatArray) -> FloatArray:
    """Return how far positions leave their limits, as a share of the joints' travel, (n,)."""
    low = np.array([joint.limits.position_min for joint in robot.joints])
    high = np.array([joint.limits.position_max for joint in robot.joints])
    beyond = np.maximum(low - q.min(axis=0), q.max(axis=0) - high)
    return np.asarray(np.maximum(beyond, 0.0) / (high - low))
