"""State of presliding hysteresis (Maxwell slip): a set of elastic elements, driven by a path.

A joint that reverses does not slide at once: asperities, teeth and balls deform first, one after
the other. The model has `ELEMENTS` elastic elements. Each element follows the displacement dq and
slips when its stretch s reaches its own distance: s <- min(max(s + dq, -w d), w d). This is the
Maxwell slip model with equal stiffness, also known as the stop operators of Prandtl and Ishlinskii
or as the Iwan model.

If only a fraction of the friction has presliding hysteresis, the rest is rigid (Coulomb). One more
element represents the rigid part; it already slips at the distance `AT_ONCE`. The hysteretic
direction of motion, between -1 and 1, is the sum of all elements divided by its largest value.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from dynamics.kernels.simd import kernel

ELEMENTS: Final = 8
"""Number of elements; their distances are evenly spread up to the presliding distance."""
AT_ONCE: Final = 1e-5
"""Slip distance of the rigid fraction [rad or m], about one count of an encoder."""
_LAST, _LOWEST, _HIGHEST, _BEGUN, _RIGID, _PIECES = 0, 1, 2, 3, 4, 5
STATE: Final = _PIECES + 2 * ELEMENTS
"""Length of a joint's state.

Last position, range reached, the rigid element, the other elements, their slopes.
"""
DIRECTION, BY_DISTANCE, BY_SHARE, KNOWN = 0, 1, 2, 3
FOUND: Final = 4
"""Number of results for each position."""


def initial_state() -> FloatArray:
    """Return the initial state of a joint: unknown history, no element is stretched."""
    return np.zeros(STATE)


@kernel
def drive_presliding(
    path: FloatArray, distance: float, share: float, state: FloatArray, out: FloatArray
) -> None:
    """Update a joint's state along a path.

    Args:
        path: Shape (samples,). Positions, in the order of time.
        distance: Presliding distance d: the displacement from rest after which the whole joint
            slides.
        share: Fraction of the friction with presliding hysteresis; the rest is rigid.
        state: Shape (STATE,). Initial state; updated, so that the next samples can continue.
        out: Shape (samples, FOUND). Written for each sample: the direction, its derivatives by the
            distance and by `share`, and 1 or 0. The last number is 1 as soon as the direction does
            not depend on the initial state, that is, when the path has covered twice the longest
            distance.
    """
    widest = 0.5 * ELEMENTS * distance
    longest = distance if share == 1.0 else max(distance, AT_ONCE)
    for i in range(len(path)):
        q = path[i]
        if state[_BEGUN] == 0.0:
            state[_BEGUN] = 1.0
            state[_LAST] = state[_LOWEST] = state[_HIGHEST] = q
        moved = q - state[_LAST]
        state[_LAST] = q
        state[_LOWEST] = min(state[_LOWEST], q)
        state[_HIGHEST] = max(state[_HIGHEST], q)
        state[_RIGID] = min(max(state[_RIGID] + moved, -AT_ONCE), AT_ONCE)
        rigid = state[_RIGID] / AT_ONCE
        total = 0.0
        slope = 0.0
        for k in range(ELEMENTS):
            part = (k + 0.5) / ELEMENTS
            stretched = state[_PIECES + k] + moved
            if stretched >= part * distance:
                stretched = part * distance
                state[_PIECES + ELEMENTS + k] = part
            elif stretched <= -part * distance:
                stretched = -part * distance
                state[_PIECES + ELEMENTS + k] = -part
            state[_PIECES + k] = stretched
            total += stretched
            slope += state[_PIECES + ELEMENTS + k]
        hysteretic = total / widest
        out[i, DIRECTION] = share * hysteretic + (1.0 - share) * rigid
        out[i, BY_DISTANCE] = share * ((slope - total / distance) / widest)
        out[i, BY_SHARE] = hysteretic - rigid
        reached = state[_HIGHEST] - state[_LOWEST]
        out[i, KNOWN] = 1.0 if reached >= 2.0 * longest else 0.0
