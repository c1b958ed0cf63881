"""Detection of a warm robot: mean power per period, and its rate of change."""

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
    """Return the mean mechanical power of each joint in each complete period, (periods, n) [W].

    `start` is the row of the motion at which the first period begins, if it is known.

    Raises:
        DataQualityError: The recording is not periodic.
    """
    if recording.samples_per_period is None or recording.sample_period_s is None:
        raise DataQualityError(
            "the warm-up is measured from period to period: use a periodic motion",
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
    """Return the change of each joint's power per period, at the last period, (n,) [%].

    The change is the slope of a line through the last `FITTED_PERIODS` periods, which reduces the
    effect of noise. It is negative if friction falls.

    Args:
        power_w: Shape (periods, n). Result of `period_powers`, at least two periods [W].
    """
    last = power_w[-FITTED_PERIODS:]
    slope = np.polyfit(np.arange(len(last)), last, 1)[0]
    size = np.maximum(np.abs(last.mean(axis=0)), LEAST_W)
    return np.asarray(100.0 * np.sign(last.mean(axis=0)) * slope / size)
