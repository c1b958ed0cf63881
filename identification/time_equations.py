"""`TimeBlock`: smoothed recordings as equations in time, block by block to bound memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.arrays import BoolArray, FloatArray, IntArray
from acquisition.smoothing import SmoothedSignals
from config.errors import EstimationError
from dynamics.robot_model import RobotModel, regressor
from identification.base_parameters import BaseParameters

BLOCK_ROWS = 4096
EVENT_S = 1.0


@dataclass(frozen=True, eq=False)
class TimeBlock:
    """Some rows of the equations rhs = matrix beta.

    Attributes
    ----------
    matrix : ndarray, shape (rows, n, b)
        Base regressor.
    rhs : ndarray, shape (rows, n)
        Torque [N m or N].
    use : ndarray of bool, shape (rows, n)
        Where the joint moves fast enough for its friction to be known.
    event : ndarray of int64, shape (rows,)
        Which stretch of `EVENT_S` seconds a row belongs to, counted over all recordings from 0.
    """

    matrix: FloatArray
    rhs: FloatArray
    use: BoolArray
    event: IntArray


def time_blocks(
    model: RobotModel,
    base: BaseParameters,
    signals: Sequence[SmoothedSignals],
    standstill_rad_s: float,
) -> Iterator[TimeBlock]:
    """Yield the equations of some recordings.

    Raises
    ------
    EstimationError
        The joints are not the model's.
    """
    first_event = 0
    for smoothed in signals:
        if smoothed.joint_names != model.joint_names:
            raise EstimationError(
                f"the recording has joints {', '.join(smoothed.joint_names)}, the model"
                f" {', '.join(model.joint_names)}: use the recording's own robot"
            )
        stretch = np.floor((smoothed.time_s - smoothed.time_s[0]) / EVENT_S).astype(np.int64)
        _, event = np.unique(
            np.column_stack([smoothed.segment, stretch]), axis=0, return_inverse=True
        )
        event = event.ravel() + first_event
        first_event = int(event[-1]) + 1
        for start in range(0, len(smoothed), BLOCK_ROWS):
            rows = slice(start, start + BLOCK_ROWS)
            v = smoothed.velocity[rows]
            phi = regressor(model, smoothed.position[rows], v, smoothed.acceleration[rows])
            yield TimeBlock(
                matrix=base.columns(phi),
                rhs=smoothed.torque_nm[rows],
                use=np.abs(v) >= standstill_rad_s,
                event=event[rows],
            )
