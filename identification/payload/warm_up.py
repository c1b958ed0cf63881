"""Whether a robot is warm: what friction takes in each period, and how much it still changes."""

from __future__ import annotations

from typing import Final

import numpy as np

from acquisition.motion.samples import Phase
from acquisition.processing.period_table import cut_periods
from acquisition.recording.recording import Recording
from config.arrays import FloatArray
from config.errors import DataQualityError

FEWEST_PERIODS: Final = 4
FITTED_PERIODS: Final = 6
LEAST_W: Final = 1e-9


def period_powers(recording: Recording, start: int | None = None) -> FloatArray:
    """Return the mean mechanical power of each joint in each whole period, (periods, n) [W].

    `start` is the row of the motion at which the first period begins, where that is known.
    """
    if recording.samples_per_period is None or recording.sample_period_s is None:
        raise DataQualityError(
            "warming up is told from periods: the motion must be periodic",
            code="RID-RECORDING-NOT-PERIODIC",
        )
    n = len(recording.joint_names)
    if int(np.count_nonzero(recording.phase == Phase.MAIN)) < recording.samples_per_period:
        return np.zeros((0, n))
    values, present = cut_periods(recording, start)
    whole = values[present.all(axis=(1, 2))]
    speed = np.gradient(whole[:, :, :n], recording.sample_period_s, axis=1)
    return np.asarray(np.mean(speed * whole[:, :, n:], axis=1))


def power_change_percent(power_w: FloatArray) -> FloatArray:
    """Return by how much each joint's power changes in a period, at the last one, (n,) [%].

    It is the slope of a line through the last `FITTED_PERIODS`, so that their noise does not
    decide; negative where friction falls.

    Args:
        power_w: Shape (periods, n). As `period_powers` tells it, two periods at least [W].
    """
    last = power_w[-FITTED_PERIODS:]
    slope = np.polyfit(np.arange(len(last)), last, 1)[0]
    size = np.maximum(np.abs(last.mean(axis=0)), LEAST_W)
    return np.asarray(100.0 * np.sign(last.mean(axis=0)) * slope / size)
