"""`friction_shapes`: time functions whose combinations represent a motor's friction.

The friction of a gear is not known when its stiffness is identified. It is eliminated from each run
as a combination of these functions of the motor's measured motion:
- presliding friction by Dahl's model (1968);
- the same times the torque, for friction that depends on load;
- the same with Stribeck's decay over speed;
- viscous friction.

The presliding distance is not known either; combinations of several distances represent the values
in between.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray

DISTANCES: Final = (5e-5, 2e-4, 8e-4)
"""Presliding distances [rad or m]."""
STRIBECK_SPEED: Final = 0.05
SETTLING_PERIODS: Final = 2


def friction_shapes(position: FloatArray, velocity: FloatArray, torque: FloatArray) -> FloatArray:
    """Return the functions of each joint in one period, shape (samples, n, functions).

    Args:
        position, velocity: Shape (samples, n). Periodic motion of the motors, finely sampled [rad
            or m, per second].
        torque: Shape (samples, n). Motor torque without noise, for friction that depends on load.
    """
    step = np.roll(position, -1, axis=0) - position
    bristles = presliding_friction(step, np.array(DISTANCES))
    slow = np.exp(-np.abs(velocity) / STRIBECK_SPEED)
    middle = bristles[:, :, 1]
    others = np.stack([velocity, middle * np.abs(torque), middle * slow], axis=2)
    return np.concatenate([bristles, others], axis=2)


def presliding_friction(step: FloatArray, distance: FloatArray) -> FloatArray:
    """Return Dahl's friction between -1 and 1 after each step, (samples, n, distances).

    Args:
        step: Shape (samples, n). Periodic displacement from sample to sample.
        distance: Shape (distances,). Displacement over which friction is established.
    """
    way = np.abs(step)[:, :, np.newaxis] / distance
    remaining = np.exp(-way)
    goal = np.sign(step)[:, :, np.newaxis] * (1.0 - remaining)
    out = np.zeros_like(way)
    state = np.zeros(way.shape[1:])
    for _ in range(SETTLING_PERIODS):
        for row in range(len(step)):
            state = remaining[row] * state + goal[row]
            out[row] = state
    return out
