"""`with_period`: values of a motion that repeat exactly in its periods, after a short blend."""

from __future__ import annotations

from typing import Final

import numpy as np

from acquisition.motion.samples import MotionSamples, Phase
from config.arrays import FloatArray

BLEND_S: Final = 0.3


def turning_rows(samples: MotionSamples) -> tuple[int, int]:
    """Return the first row of the first period of a motion, and the row after its last period."""
    turning = np.flatnonzero((samples.phase == Phase.MAIN) | (samples.phase == Phase.TRANSIENT))
    return int(turning[0]), int(turning[-1]) + 1


def with_period(samples: MotionSamples, rows: FloatArray, period: FloatArray) -> FloatArray:
    """Blend a motion's values smoothly into those of one period, and back after the last period.

    Args:
        samples: A periodic motion.
        rows: Shape (samples, n). Values of the whole motion; used before and after the periods.
        period: Shape (samples_per_period, n). Values of the last period; all periods are equal.
    """
    first, last = turning_rows(samples)
    number = np.arange(len(samples))
    # Row k of the motion is row (k - last) modulo the period's length.
    exact = period[(number - last) % len(period)]
    over = max(1, round(BLEND_S / samples.sample_period_s))
    x = np.clip(np.minimum(number - first, last + over - number) / over, 0.0, 1.0)
    weight = (x * x * (3.0 - 2.0 * x))[:, np.newaxis]
    return np.asarray(rows + weight * (exact - rows))


def period_rows(samples: MotionSamples) -> slice:
    """Return the rows of the last period of a periodic motion."""
    assert samples.samples_per_period is not None
    last = turning_rows(samples)[1]
    return slice(last - samples.samples_per_period, last)
