"""`dead_torques`: joints that move with a constant recorded torque."""

from __future__ import annotations

import numpy as np

from acquisition.processing.periods import PeriodAverage
from acquisition.recording.recording import Recording
from config.column_file import each_column

MOVES = 0.01
SAME = 1e-9


def dead_torques(measured: Recording | PeriodAverage) -> dict[str, float]:
    """Return the joints that move with a constant recorded torque, and this torque.

    No robot moves by more than 0.01 rad or m with a constant torque [N m or N]: the column is
    wrong, or nothing was logged.
    """
    position, torque_nm = measured.position, measured.torque_nm
    if isinstance(measured, Recording):
        position, torque_nm = measured.valid_rows("position"), measured.valid_rows("torque_nm")
    if not len(position):
        return {}
    columns = each_column(position), each_column(torque_nm)
    return {
        name: float(torque[0])
        for name, q, torque in zip(measured.joint_names, *columns, strict=True)
        if np.ptp(q) > MOVES and np.ptp(torque) <= SAME * max(abs(torque.min()), abs(torque.max()))
    }
