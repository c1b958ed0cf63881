"""What belongs to the period of a motion, spread over all its rows: run-in and run-out too."""

from __future__ import annotations

from typing import Final

import numpy as np

from acquisition.motion.samples import MotionSamples, Phase
from config.arrays import FloatArray

BLEND_S: Final = 0.3


def turning_rows(samples: MotionSamples) -> tuple[int, int]:
    """Return the first row of a periodic motion's first period, and the one after its last."""
    turning = np.flatnonzero((samples.phase == Phase.MAIN) | (samples.phase == Phase.TRANSIENT))
    return int(turning[0]), int(turning[-1]) + 1


def with_period(samples: MotionSamples, rows: FloatArray, period: FloatArray) -> FloatArray:
    """Return rows of a motion that go over into those of its last period, and out again.

    Parameters
    ----------
    samples : MotionSamples
        A periodic motion.
    rows : ndarray, shape (samples, n)
        Values before and after the periods.
    period : ndarray, shape (samples_per_period, n)
        Values of its last period, and of every other.
    """
    first, last = turning_rows(samples)
    number = np.arange(len(samples))
    # The motion's row k is row (k - last) of the period, everywhere.
    exact = period[(number - last) % len(period)]
    over = max(1, round(BLEND_S / samples.sample_period_s))
    x = np.clip(np.minimum(number - first, last + over - number) / over, 0.0, 1.0)
    weight = (x * x * (3.0 - 2.0 * x))[:, np.newaxis]
    return np.asarray(rows + weight * (exact - rows))
