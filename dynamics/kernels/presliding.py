"""The state of friction with memory: a row of elastic pieces that slip, driven by a path.

A joint that turns round does not slide at once: asperities, teeth and balls give way first, one
after the other. Each of `ELEMENTS` pieces follows the displacement and slips where it is stretched
by its own distance, s <- min(max(s + dq, -w d), w d): Prandtl's and Ishlinskii's stop operators,
Iwan's or the Maxwell slip model with equal stiffness. Their sum over its largest value is the
direction of motion with memory, between -1 and 1.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from dynamics.kernels.simd import kernel

ELEMENTS: Final = 8
"""Pieces, their distances evenly spread up to the presliding distance."""
_LAST, _LOWEST, _HIGHEST, _BEGUN, _PIECES = 0, 1, 2, 3, 4
STATE: Final = _PIECES + 2 * ELEMENTS
"""Numbers that a joint's state is made of: last position, reached range, pieces, their slopes."""
DIRECTION, SLOPE, KNOWN = 0, 1, 2


def begin() -> FloatArray:
    """Return the state of a joint of which nothing is known yet: no piece is stretched."""
    return np.zeros(STATE)


@kernel
def follow(path: FloatArray, distance: float, state: FloatArray, out: FloatArray) -> None:
    """Drive a joint's state along a path.

    Parameters
    ----------
    path : (samples,) array
        Positions, in the order of time.
    distance : float
        Presliding distance d: what a joint at rest is moved until all of it slides.
    state : (STATE,) array
        Where it begins; left as it is at the end, so that the next samples go on from there.
    out : (samples, 3) array
        Written: the direction, its derivative by the distance, and 1 from where on the direction
        does not depend on the state that the path began with (a range of 2 d was gone through),
        otherwise 0.
    """
    widest = 0.5 * ELEMENTS * distance
    for i in range(len(path)):
        q = path[i]
        if state[_BEGUN] == 0.0:
            state[_BEGUN] = 1.0
            state[_LAST] = state[_LOWEST] = state[_HIGHEST] = q
        moved = q - state[_LAST]
        state[_LAST] = q
        state[_LOWEST] = min(state[_LOWEST], q)
        state[_HIGHEST] = max(state[_HIGHEST], q)
        total = 0.0
        slope = 0.0
        for k in range(ELEMENTS):
            share = (k + 0.5) / ELEMENTS
            stretched = state[_PIECES + k] + moved
            if stretched >= share * distance:
                stretched = share * distance
                state[_PIECES + ELEMENTS + k] = share
            elif stretched <= -share * distance:
                stretched = -share * distance
                state[_PIECES + ELEMENTS + k] = -share
            state[_PIECES + k] = stretched
            total += stretched
            slope += state[_PIECES + ELEMENTS + k]
        out[i, DIRECTION] = total / widest
        out[i, SLOPE] = (slope - total / distance) / widest
        reached = state[_HIGHEST] - state[_LOWEST]
        out[i, KNOWN] = 1.0 if reached >= 2.0 * distance else 0.0
