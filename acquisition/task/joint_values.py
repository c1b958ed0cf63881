"""`JointValues`: measured values of the latest cycles relative to their limits, for displays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.journal.cycle_row import row_dtype
from acquisition.task.ring import Ring
from config.cell.cell import CellConfig
from config.robot.robot import RobotDescription

WINDOW_S = 0.05


@dataclass(frozen=True)
class JointValues:
    """Values of the joints in the latest cycle; every array has one value per joint.

    Attributes:
        time_s: Time of the cycle's SYNC on the cyclic task's clock [s].
        position, velocity: Measured position [rad or m], and mean velocity over the last `WINDOW_S`
            [rad/s or m/s].
        torque: Measured torque [N m or N].
        torque_share: Largest absolute torque within `WINDOW_S`, divided by the joint's limit.
        following_error: Set-point minus position [rad or m].
        following_error_share: Largest absolute following error within `WINDOW_S`, divided by the
            supervisor's limit at the speed of the feedforward.
        valid: True if the joint's drive answered plausibly; else the values are old.
    """

    time_s: float
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    torque: NDArray[np.float64]
    torque_share: NDArray[np.float64]
    following_error: NDArray[np.float64]
    following_error_share: NDArray[np.float64]
    valid: NDArray[np.bool_]


class JointWatch:
    """Reads the latest rows of the ring without removing them.

    Args:
        ring: Ring between cyclic task and recorder.
        cell, robot: Cycle time and limits.
    """

    def __init__(self, ring: Ring, cell: CellConfig, robot: RobotDescription) -> None:
        self._ring = ring
        self._dtype = row_dtype(ring.joints)
        self._rows = 1 + max(1, round(WINDOW_S / cell.cycle_time_s))
        self._torque_limit = np.array([joint.limits.torque for joint in robot.joints])
        self._rules = cell.supervision

    def look(self) -> JointValues | None:
        """Return the values of the latest cycle; None before the first."""
        rows = np.frombuffer(self._ring.latest(self._rows), dtype=self._dtype)
        if not len(rows):
            return None
        last = rows[-1]
        elapsed_s = float(last["time_s"] - rows[0]["time_s"])
        moved = last["position"] - rows[0]["position"]
        errors = rows["target_position"] - rows["position"]
        rules = self._rules
        allowed = rules.following_error_min_rad + rules.following_error_per_velocity_s * np.abs(
            rows["target_velocity"]
        )
        return JointValues(
            time_s=float(last["time_s"]),
            position=last["position"].copy(),
            velocity=moved / elapsed_s if elapsed_s > 0.0 else np.zeros_like(moved),
            torque=last["torque_nm"].copy(),
            torque_share=(np.abs(rows["torque_nm"]) / self._torque_limit).max(axis=0),
            following_error=errors[-1],
            following_error_share=(np.abs(errors) / allowed).max(axis=0),
            valid=last["valid"].astype(np.bool_),
        )
