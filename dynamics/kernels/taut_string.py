"""The taut-string path: the shortest path between a lower and an upper bound over time.

Of all paths within the bounds and with the same ends, it has the smallest total variation. Like a
string that is pulled taut, it is straight except at points at which it touches a bound. Sources:
Lee and Preparata 1984 (funnel algorithm), Davies and Kovac 2001 (taut string). The funnel algorithm
keeps the last corner of the string and, from this corner, the two sides of a funnel: the parts of
the lower and of the upper bound that the string could touch. If a new bound closes the funnel, the
string continues to the next corner of the opposite side. Each bound is added to a side once and
removed from it at most once.
"""

from __future__ import annotations

import numpy as np

from config.arrays import FloatArray
from dynamics.kernels.simd import kernel


@kernel
def pull_taut(time_s: FloatArray, low: FloatArray, high: FloatArray, path: FloatArray) -> None:
    """Compute the taut-string path; it starts and ends midway between the bounds.

    Args:
        time_s: Shape (samples,). Times, strictly increasing [s].
        low, high: Shape (samples,). The lower and upper bounds; low <= high.
        path: Shape (samples,). Output: the path.
    """
    last = len(time_s) - 1
    bounds = np.empty((2, last + 1))  # the upper bound is negated, so that both sides are concave
    for i in range(last + 1):
        bounds[0, i], bounds[1, i] = low[i], -high[i]
    for i in (0, last):
        path[i] = 0.5 * (low[i] + high[i])
        bounds[0, i], bounds[1, i] = path[i], -path[i]
    sides = np.zeros((2, last + 1), dtype=np.int64)  # number of samples on each side of the corner
    begin, end = np.array([0, 0]), np.array([1, 1])
    for i in range(1, last + 1):
        for own in range(2):
            side, bound, other = sides[own], bounds[own], 1 - own
            while end[own] - begin[own] > 1:
                a, b = side[end[own] - 2], side[end[own] - 1]
                if _slope(time_s, bound, a, i) < _slope(time_s, bound, a, b):
                    break
                end[own] -= 1
            while end[own] - begin[own] == 1 and end[other] - begin[other] > 1:
                a, b = sides[other, begin[other]], sides[other, begin[other] + 1]
                slope = -_slope(time_s, bounds[other], a, b)
                if _slope(time_s, bound, a, i) < slope:
                    break
                bound[b] = -bounds[other, b]
                sign = 1.0 - 2.0 * own
                for k in range(a + 1, b):
                    path[k] = sign * (bound[a] + slope * (time_s[k] - time_s[a]))
                path[b] = sign * bound[b]
                side[begin[own]] = b
                begin[other] += 1
            if side[end[own] - 1] < i:
                side[end[own]] = i
                end[own] += 1


@kernel
def _slope(time_s: FloatArray, bound: FloatArray, a: int, b: int) -> float:
    return float((bound[b] - bound[a]) / (time_s[b] - time_s[a]))
