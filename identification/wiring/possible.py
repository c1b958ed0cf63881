"""Check that a corrected motion and its torques are possible, and that the correction is testable.

`keeps_limits` compares them with the joints' limits. `keeps_torques` requires that the correction
does not remove torques from the fit.
"""

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
    """Return True if the joints are capable of the corrected motion and torques.

    With the mistake corrected, three conditions must hold, with tolerances of 20 % for torques and
    speeds and of 5 % of the range for positions:
    - A joint that kept a limit of the robot file before still keeps it.
    - A joint that exceeded a limit before does not exceed it more.
    - A joint that kept its limits does not become nearly motionless or torque-free.

    Args:
        mistake: The mistake to correct.
        stated, undone: Signals with the mistake, and with the mistake corrected.
    """
    limits = [joint.limits for joint in stated.robot.joints]
    torque = np.array([limit.torque for limit in limits])
    if mistake.changes_torque and not _limits_kept(
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
    outside = _distance_outside_limits(stated.robot, q)
    over = np.maximum(before, np.where(outside > BEYOND_TRAVEL, np.inf, 0.0))
    if not _limits_kept(before, after, LEAST_MOTION, over):
        return False
    right_outside = _distance_outside_limits(stated.robot, right_q)
    return bool(np.all((right_outside <= BEYOND_TRAVEL) | (right_outside <= outside + 1e-9)))


def keeps_torques(mistake: Mistake, stated: WiredSignals, undone: WiredSignals) -> bool:
    """Return False if the fit is better only because a varying torque is no longer part of it.

    The torque of a joint at rest is not fitted, because its friction is unknown. A wrong order can
    assign a joint's torque to a joint at rest, and its constant torque to the joint that moves;
    every robot can explain that. Such a correction counts only if the torque that enters the fit
    varies at least as much as the one that leaves it.

    Args:
        mistake: The mistake to correct.
        stated, undone: Signals with the mistake, and with the mistake corrected.
    """
    used = (mistake.torque != 0.0)[undone.moving].any(axis=0)
    lost, gained = stated.moving & ~used, used & ~stated.moving
    spread = stated.torque_nm.std(axis=0)
    return float(spread[gained].max(initial=0.0)) >= float(spread[lost].max(initial=0.0))


def _limits_kept(
    before: FloatArray, after: FloatArray, least: float, over: FloatArray | None = None
) -> bool:
    """Return True if values relative to limits, (n,), are possible after a correction.

    `before` and `after` are the values before and after the correction; `over` (by default
    `before`) is above the limit for a joint that exceeded a limit before.
    """
    beyond = before if over is None else over
    too_much = (after > BEYOND) & (after > before * (1.0 + 1e-9))
    too_little = (after < least) & (after < before * (1.0 - 1e-9)) & (beyond <= BEYOND)
    return not bool(np.any(too_much | too_little))


def _distance_outside_limits(robot: RobotDescription, q: FloatArray) -> FloatArray:
    """Return the distance by which positions leave their limits, relative to the range, (n,)."""
    low = np.array([joint.limits.position_min for joint in robot.joints])
    high = np.array([joint.limits.position_max for joint in robot.joints])
    beyond = np.maximum(low - q.min(axis=0), q.max(axis=0) - high)
    return np.asarray(np.maximum(beyond, 0.0) / (high - low))
