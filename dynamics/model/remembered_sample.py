"""The model's torque for one sample of a path whose friction remembers, a sample after another.

What joints remember (`dynamics.kernels.presliding`) is kept by the caller, so that a path can be
gone on with where it was left: it depends on where joints went, not on when.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from dynamics.kernels.friction import BY_SPEED
from dynamics.kernels.presliding import DIRECTION, STATE, follow
from dynamics.kernels.simd import kernel
from dynamics.model import one_sample
from dynamics.model.one_sample import ModelArrays, sample_torque

LAST: Final = 0
"""Word of a joint's state: where it was."""


def unknown(joints: int) -> FloatArray:
    """Return the state of joints of which nothing is known, (n, `STATE`): nothing is stretched."""
    return np.zeros((joints, STATE))


@kernel
def go_to(q: FloatArray, presliding: FloatArray, state: FloatArray, found: FloatArray) -> None:
    """Go on to a pose.

    Args:
        q: Shape (n,). Positions of the actuators, link side [rad or m].
        presliding: Shape (2, n). `SampleTorque.presliding`.
        state: Shape (n, STATE). What joints remember; written.
        found: Shape (n, FOUND). Written: what each has in place of sign(v), -1 to 1, and what else
            `follow` tells; `BY_SPEED` for joints that remember nothing.
    """
    for j in range(len(q)):
        if presliding[0, j] > 0.0:
            follow(q[j : j + 1], presliding[0, j], presliding[1, j], state[j], found[j : j + 1])
        else:
            found[j, DIRECTION] = BY_SPEED


@kernel
def remembered_torque(
    model: ModelArrays,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    found: FloatArray,
    torque: FloatArray,
) -> None:
    """Compute the actuators' torques of one sample.

    Args:
        model, q, v, a, torque: As for `sample_torque`.
        found: Shape (n, FOUND). As `go_to` writes it.
    """
    n = len(q)
    told = model[6][n + one_sample.DIRECTION]
    for j in range(n):
        told[j] = found[j, DIRECTION]
    sample_torque(model, q, v, a, torque)
    for j in range(n):
        told[j] = BY_SPEED
