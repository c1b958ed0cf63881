"""The model's torque with presliding hysteresis, computed sample by sample along a path.

The caller stores the state of the hysteresis (`dynamics.kernels.presliding`) between the samples.
The state depends on the joints' path, not on time.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from dynamics.kernels.friction import BY_SPEED
from dynamics.kernels.presliding import DIRECTION, STATE, drive_presliding
from dynamics.kernels.simd import kernel
from dynamics.model import one_sample
from dynamics.model.one_sample import ModelArrays, sample_torque

LAST: Final = 0
"""Index of the last position in the state of a joint."""


def initial_states(joints: int) -> FloatArray:
    """Return the initial states of joints, (n, `STATE`): no position, no stretched element."""
    return np.zeros((joints, STATE))


@kernel
def update_presliding(
    q: FloatArray, presliding: FloatArray, state: FloatArray, found: FloatArray
) -> None:
    """Update the hysteresis of all joints for the next positions on the path.

    Args:
        q: Shape (n,). Positions of the actuators, link side [rad or m].
        presliding: Shape (2, n). As `SampleTorque.presliding`.
        state: Shape (n, STATE). State of the hysteresis; updated.
        found: Shape (n, FOUND). Output: the results of `drive_presliding` for each joint. The first
            result is the direction, -1 to 1, which replaces sign(v); for joints without presliding
            it is `BY_SPEED`, and the other results are left unchanged.
    """
    for j in range(len(q)):
        if presliding[0, j] > 0.0:
            drive_presliding(
                q[j : j + 1], presliding[0, j], presliding[1, j], state[j], found[j : j + 1]
            )
        else:
            found[j, DIRECTION] = BY_SPEED


@kernel
def hysteretic_torque(
    model: ModelArrays,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    found: FloatArray,
    torque: FloatArray,
) -> None:
    """Compute the actuators' torques of one sample, with the given hysteresis.

    Args:
        model, q, v, a, torque: As for `sample_torque`.
        found: Shape (n, FOUND). The output of `update_presliding`.
    """
    n = len(q)
    directions = model[6][n + one_sample.DIRECTION]
    for j in range(n):
        directions[j] = found[j, DIRECTION]
    sample_torque(model, q, v, a, torque)
    for j in range(n):
        directions[j] = BY_SPEED
