"""Zero-phase low-pass filter for many columns: second-order sections, forwards and backwards.

Columns are filtered in groups of `COLUMNS`, so that the filter states of a group stay in the
processor's fastest cache. Each pass starts in the steady state for a signal that has always had its
first value.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from dynamics.kernels.simd import kernel

COLUMNS: Final = 32
"""Number of columns that are filtered together."""


@kernel
def filter_both_ways(sections: FloatArray, start: FloatArray, values: FloatArray) -> None:
    """Filter columns forwards, then backwards, in place.

    Args:
        sections: Shape (k, 6). Coefficients b0, b1, b2, 1, a1, a2 of each section, in the order of
            application.
        start: Shape (k, 2). Steady state of each section for a constant input of 1 to the first
            section (transposed direct form II).
        values: Shape (samples, columns). The signals, C-ordered; overwritten with the result.
    """
    samples, columns = values.shape
    first = np.empty((len(sections), COLUMNS))
    second = np.empty((len(sections), COLUMNS))
    for left in range(0, columns, COLUMNS):
        width = min(COLUMNS, columns - left)
        for way in range(2):
            begin = 0 if way == 0 else samples - 1
            step = 1 if way == 0 else -1
            for s in range(len(sections)):
                for c in range(width):
                    first[s, c] = start[s, 0] * values[begin, left + c]
                    second[s, c] = start[s, 1] * values[begin, left + c]
            for i in range(samples):
                row = values[begin + step * i, left : left + width]
                for s in range(len(sections)):
                    b0, b1, b2 = sections[s, 0], sections[s, 1], sections[s, 2]
                    a1, a2 = sections[s, 4], sections[s, 5]
                    for c in range(width):
                        x = row[c]
                        y = b0 * x + first[s, c]
                        first[s, c] = b1 * x - a1 * y + second[s, c]
                        second[s, c] = b2 * x - a2 * y
                        row[c] = y
