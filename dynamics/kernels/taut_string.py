"""The shortest path through a tube: a string that is pulled taut between two bounds.

Of all paths through bounds that move with time it goes back and forth least: where the bounds let
it, it is straight, and it turns at their corners only (funnel algorithm: Lee and Preparata 1984;
taut string: Davies and Kovac 2001).
"""

from __future__ import annotations

import math

from config.arrays import FloatArray
from dynamics.kernels.simd import kernel


@kernel
def pull_taut(time_s: FloatArray, low: FloatArray, high: FloatArray, path: FloatArray) -> None:
    """Find the shortest path through bounds, from the middle of the first to that of the last.

    Parameters
    ----------
    time_s : (samples,) array
        Strictly ascending.
    low, high : (samples,) arrays
        The bounds, low at most high.
    path : (samples,) array
        Written.
    """
    last = len(time_s) - 1
    corner = 0
    path[0] = 0.5 * (low[0] + high[0])
    while corner < last:
        # The slopes with which a straight way from the corner passes all bounds so far, and where
        # those are that leave no more.
        flattest, steepest = -math.inf, math.inf
        at_flattest, at_steepest = last, last
        turn, end = last, 0.5 * (low[last] + high[last])
        for i in range(corner + 1, last + 1):
            span = time_s[i] - time_s[corner]
            below, above = (low[i], high[i]) if i < last else (end, end)
            least, most = (below - path[corner]) / span, (above - path[corner]) / span
            if least > steepest:
                turn, end = at_steepest, high[at_steepest]
                break
            if most < flattest:
                turn, end = at_flattest, low[at_flattest]
                break
            if least >= flattest:
                flattest, at_flattest = least, i
            if most <= steepest:
                steepest, at_steepest = most, i
        slope = (end - path[corner]) / (time_s[turn] - time_s[corner])
        for i in range(corner + 1, turn):
            path[i] = path[corner] + slope * (time_s[i] - time_s[corner])
        path[turn] = end
        corner = turn
