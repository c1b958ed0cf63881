"""The state of friction with memory: a row of elastic pieces that slip, driven by a path.

A joint that turns round does not slide at once: asperities, teeth and balls give way first, one
after the other. Each of `ELEMENTS` pieces follows the displacement and slips where it is stretched
by its own distance, s <- min(max(s + dq, -w d), w d): Prandtl's and Ishlinskii's stop operators,
Iwan's or the Maxwell slip model with equal stiffness. Where only a share of the friction gives way
so, the rest holds at once: one more piece that slips at `AT_ONCE`. Their sum over its largest value
is the direction of motion with memory, between -1 and 1.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from dynamics.kernels.simd import kernel

ELEMENTS: Final = 8
"""Pieces, their distances evenly spread up to the presliding distance."""
AT_ONCE: Final = 1e-5
"""Distance of what holds at once [rad or m]: of the size of an encoder's count."""
_LAST, _LOWEST, _HIGHEST, _BEGUN, _HELD, _PIECES = 0, 1, 2, 3, 4, 5
STATE: Final = _PIECES + 2 * ELEMENTS
"""Numbers that a joint's state is made of.

Last position, reached range, the piece that holds at once, the others, their slopes.
"""
DIRECTION, BY_DISTANCE, BY_SHARE, KNOWN = 0, 1, 2, 3
FOUND: Final = 4
"""Numbers that are told of each position."""


def begin() -> FloatArray:
    """Return the state of a joint of which nothing is known yet: no piece is stretched."""
    return np.zeros(STATE)


@kernel
def follow(
    path: FloatArray, distance: float, share: float, state: FloatArray, out: FloatArray
) -> None:
    """Drive a joint's state along a path.

    Args:
        path: Shape (samples,). Positions, in the order of time.
        distance: Presliding distance d: what a joint at rest is moved until all of it slides.
        share: Share of its friction that gives way over that distance; the rest holds at once.
        state: Shape (STATE,). Where it begins; left as it is at the end, so that the next samples
            go on from there.
        out: Shape (samples, FOUND). Written: the direction, its derivatives by the distance and by
            the share, and 1 from where on the direction does not depend on the state that the path
            began with (twice the longest distance was gone through), otherwise 0.
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
        state[_HELD] = min(max(state[_HELD] + moved, -AT_ONCE), AT_ONCE)
        held = state[_HELD] / AT_ONCE
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
        given = total / widest
        out[i, DIRECTION] = share * given + (1.0 - share) * held
        out[i, BY_DISTANCE] = share * ((slope - total / distance) / widest)
        out[i, BY_SHARE] = given - held
        reached = state[_HIGHEST] - state[_LOWEST]
        out[i, KNOWN] = 1.0 if reached >= 2.0 * longest else 0.0
