"""Lateness of cycles on a computer that sometimes stalls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def calm_p99(late_s: NDArray[np.float64], cycles: int) -> float:
    """Return the lower quartile of the p99 lateness of time windows of `cycles` cycles each [s].

    Stalls of a computer come in bursts and affect every process. The p99 of all cycles therefore
    mainly counts these bursts. The quartile ignores events that occur in fewer than three of four
    windows, or in less than 1 % of a window's cycles. Print the p99 of all cycles as well.
    """
    windows = late_s[: len(late_s) // cycles * cycles].reshape(-1, cycles)
    return float(np.quantile(np.quantile(windows, 0.99, axis=1), 0.25))
