"""`clipped_ends`: extreme values that are far more frequent than the values next to them.

A source that clips a quantity writes its limit again and again. A peak also returns to its extreme
value, but the values next to the peak are then about as frequent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FEWEST_VALUES = 50
NEAR_VALUES = 5
FEWEST_ROWS = 20
TIMES = 10
"""An extreme value is clipped if it is this often as frequent as each of the next values."""


@dataclass(frozen=True)
class ClippedEnds:
    """Limits at which a quantity is clipped.

    Attributes:
        values: The limits.
        share: Fraction of the rows at a limit.
    """

    values: tuple[float, ...]
    share: float

    @property
    def phrase(self) -> str:
        """The limits and the fraction of the rows."""
        where = " and ".join(f"{value:.4g}" for value in self.values)
        return f"exactly {where} in {100.0 * self.share:.2g} % of the rows in motion"


def clipped_ends(series: NDArray[np.generic]) -> ClippedEnds | None:
    """Return the limits at which a series of values, (rows,), is clipped; None if it is not.

    Give only rows in motion: at rest all quantities are constant.
    """
    values, counts = np.unique(series, return_counts=True)
    if len(values) < FEWEST_VALUES:
        return None
    ends = []
    for end, inner in ((-1, counts[-1 - NEAR_VALUES : -1]), (0, counts[1 : NEAR_VALUES + 1])):
        times = np.count_nonzero(np.diff(series == values[end]))  # one stuck stretch has two
        if times > 2 and counts[end] > max(FEWEST_ROWS, TIMES * int(inner.max())):
            ends.append((float(values[end]), int(counts[end])))
    if not ends:
        return None
    share = sum(count for _, count in ends) / len(series)
    return ClippedEnds(tuple(value for value, _ in ends), share)
