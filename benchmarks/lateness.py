"""How late cycles begin on a computer that itself stands still now and then."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def calm_p99(late_s: NDArray[np.float64], cycles: int) -> float:
    """Return the p99 within so many cycles that a quarter of such windows do not exceed [s].

    A computer's stalls come in storms and hit whoever runs; a p99 of all cycles says above all how
    many there were. What happens less often than in three windows of four, or to less than 1 % of
    their cycles, is not seen here: the p99 of all belongs beside it.
    """
    windows = late_s[: len(late_s) // cycles * cycles].reshape(-1, cycles)
    return float(np.quantile(np.quantile(windows, 0.99, axis=1), 0.25))
