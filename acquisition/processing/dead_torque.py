"""`dead_torques`: joints that move with a constant recorded torque."""

from __future__ import annotations

import numpy as np

from acquisition.processing.periods import PeriodAverage
from acquisition.recording.recording import Recording

MOVES = 0.01
SAME = 1e-9


def dead_torques(measured: Recording | PeriodAverage) -> dict[str, float]:
    """Return the joints that move with a constant recorded torque, and this torque.

    No robot moves by more than 0.01 rad or m with a constant torque [N m or N]: the column is
    wrong, or nothing was logged.
    """
    whole = measured.valid if isinstance(measured, Recording) else slice(None)
    position, torque_nm = measured.position[whole], measured.torque_nm[whole]
    if not len(position):
        return {}
    moved = np.ptp(position, axis=0) > MOVES
    same = np.ptp(torque_nm, axis=0) <= SAME * np.abs(torque_nm).max(axis=0)
    return {
        name: float(torque_nm[0, j])
        for j, name in enumerate(measured.joint_names)
        if moved[j] and same[j]
    }
