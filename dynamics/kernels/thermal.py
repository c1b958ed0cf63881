"""Temperature rise of a heated body that its surroundings cool, as a first-order lag."""

from __future__ import annotations

import numpy as np

from config.arrays import FloatArray
from dynamics.kernels.simd import kernel

RISE, BY_TIME_CONSTANT = 0, 1


@kernel
def warm_up(time_s: FloatArray, heat: FloatArray, time_constant_s: float, out: FloatArray) -> None:
    """Compute the temperature rise x by T dx/dt = heat - x, starting at x = 0 (cold).

    Args:
        time_s: Shape (samples,). Times, increasing [s].
        heat: Shape (samples,). Heat flow from each sample until the next one, expressed as the
            steady temperature rise that it would cause [K].
        time_constant_s: Time constant T [s].
        out: Shape (samples, 2). Output: the temperature rise, and its derivative with respect
            to the time constant.
    """
    rise = 0.0
    slope = 0.0
    for i in range(len(time_s)):
        if i > 0:
            step = time_s[i] - time_s[i - 1]
            kept = np.exp(-step / time_constant_s)
            ahead = rise - heat[i - 1]
            slope = kept * (slope + ahead * step / time_constant_s**2)
            rise = heat[i - 1] + kept * ahead
        out[i, RISE] = rise
        out[i, BY_TIME_CONSTANT] = slope
