"""Presliding hysteresis of a joint (Maxwell slip): elastic elements that follow the joint's path.

After a reversal a joint does not slide immediately: first asperities, gear teeth and bearing balls
deform elastically, one after the other. The model has `ELEMENTS` elastic elements. The stretch s of
an element follows the displacement dq of the joint, until it reaches the element's fraction w of
the presliding distance d, at which the element slips: s <- min(max(s + dq, -w d), w d). This is the
Maxwell slip model with equal stiffness, also known as the stop operators of Prandtl and Ishlinskii
or as the Iwan model.

If only a fraction of the friction has presliding hysteresis, the rest is rigid (Coulomb). An
additional element represents the rigid part; it already slips at the distance `RIGID_SLIP`. The
hysteretic direction of motion, between -1 and 1, is the sum of the stretches divided by its largest
possible value; the rigid part is weighted with its fraction.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from dynamics.kernels.simd import kernel

ELEMENTS: Final = 8
"""Number of elastic elements; the distances at which they slip are evenly spread from 0 to the
presliding distance."""
RIGID_SLIP: Final = 1e-5
"""Distance at which the element of the rigid part slips [rad or m], about one encoder count."""
_LAST, _LOWEST, _HIGHEST, _BEGUN, _RIGID, _PIECES = 0, 1, 2, 3, 4, 5
STATE: Final = _PIECES + 2 * ELEMENTS
"""Number of values in the state of a joint.

The values are: last position, lowest and highest position, 1 after the first position, stretch of
the rigid element, stretches of the elastic elements, and the derivatives of these stretches by the
presliding distance.
"""
DIRECTION, BY_DISTANCE, BY_FRACTION, KNOWN = 0, 1, 2, 3
FOUND: Final = 4
"""Number of results for each position: direction, its two derivatives, and if it is known."""


def initial_state() -> FloatArray:
    """Return the initial state of a joint: no position yet, no element is stretched."""
    return np.zeros(STATE)


@kernel
def drive_presliding(
    path: FloatArray, distance: float, fraction: float, state: FloatArray, out: FloatArray
) -> None:
    """Update a joint's state along a path, and compute its hysteretic direction of motion.

    Args:
        path: Shape (samples,). Positions of the joint in the order of time [rad or m].
        distance: Presliding distance d, the displacement from rest after which the whole joint
            slides [rad or m].
        fraction: Fraction of the friction with presliding hysteresis; the rest is rigid.
        state: Shape (STATE,). State before the path; overwritten with the state after it, so that a
            following path can continue.
        out: Shape (samples, FOUND). Output for each sample: the direction, its derivatives by
            `distance` and by `fraction`, and 1 if the direction is known, else 0. It is known as
            soon as the positions span 2 d, and 2 `RIGID_SLIP` if there is a rigid part. From then
            on it does not depend on the initial state.
    """
    widest = 0.5 * ELEMENTS * distance
    longest = distance if fraction == 1.0 else max(distance, RIGID_SLIP)
    for i in range(len(path)):
        q = path[i]
        if state[_BEGUN] == 0.0:
            state[_BEGUN] = 1.0
            state[_LAST] = state[_LOWEST] = state[_HIGHEST] = q
        moved = q - state[_LAST]
        state[_LAST] = q
        state[_LOWEST] = min(state[_LOWEST], q)
        state[_HIGHEST] = max(state[_HIGHEST], q)
        state[_RIGID] = min(max(state[_RIGID] + moved, -RIGID_SLIP), RIGID_SLIP)
        rigid = state[_RIGID] / RIGID_SLIP
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
        out[i, DIRECTION] = fraction * hysteretic + (1.0 - fraction) * rigid
        out[i, BY_DISTANCE] = fraction * ((slope - total / distance) / widest)
        out[i, BY_FRACTION] = hysteretic - rigid
        reached = state[_HIGHEST] - state[_LOWEST]
        out[i, KNOWN] = 1.0 if reached >= 2.0 * longest else 0.0
