"""`golden_section`: minimum of a cost with one variable."""

from __future__ import annotations

import math
from collections.abc import Callable


def golden_section(cost: Callable[[float], float], low: float, high: float, step: float) -> float:
    """Return the place of the minimum of a cost that has only one, by golden section search.

    `scipy.optimize` provides this, but its import takes more memory and time than all trials.

    Args:
        cost: The cost of a value.
        low, high: The interval of the values.
        step: Length of the last interval.
    """
    share = 0.5 * (math.sqrt(5.0) - 1.0)
    left, right = high - share * (high - low), low + share * (high - low)
    of_left, of_right = cost(left), cost(right)
    while high - low > step:
        if of_left < of_right:
            high, right, of_right = right, left, of_left
            left = high - share * (high - low)
            of_left = cost(left)
        else:
            low, left, of_left = left, right, of_right
            right = low + share * (high - low)
            of_right = cost(right)
    return 0.5 * (low + high)
