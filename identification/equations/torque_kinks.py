"""Correction of sampled torques at kinks, so that their sums over rows equal their integrals.

If a joint reverses between two rows, its Coulomb friction jumps, and with it the acceleration of
every joint. The controllers of the other joints respond with torques that are continuous but have a
kink. Least squares uses sums over rows. For the columns these sums equal integrals, because the
columns follow a spline through the positions. For a sampled torque with a kink they do not: if the
joint reverses phi rows after a row, the sum misses the integral by B2(phi)/2 times the change of
slope, and by terms of higher order (Euler and Maclaurin). B2, and B3 and B4 in the other terms, are
Bernoulli polynomials. At 100 Hz this error alone shifts friction by 0.1 %.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from acquisition.processing.unfiltered import SLOW_RAD_S
from config.arrays import FloatArray, IntArray

MOST_ROWS: Final = 6
"""Longest reversal [rows] that counts as one event; a longer one is a stop and a start."""
BEFORE: Final = 4
AFTER: Final = 4
"""Last row that the weights use, counted from the last row before a kink."""


def integrable_torque(
    torque_nm: FloatArray, position: FloatArray, velocity: FloatArray
) -> FloatArray:
    """Return torques corrected so that sums with smooth weights equal integrals.

    A joint's torque is corrected at the reversals of other joints. At its own reversals the torque
    jumps, and estimates without presliding do not use it there.

    Args:
        torque_nm: Shape (samples, n). Sampled torque on uniform rows of one segment [N m or N].
        position, velocity: Shape (samples, n). Motion [rad or m, and per second].
    """
    time, joint = _reversals(position, velocity)
    row = np.floor(time).astype(np.int64)
    inside = (row >= BEFORE) & (row + AFTER < len(torque_nm))
    row, joint, phi = row[inside], joint[inside], (time - row)[inside]
    near = torque_nm[row[:, np.newaxis] + np.arange(-BEFORE, AFTER + 1)]
    missing = np.einsum("em,emj->ej", _weights(phi), near)
    missing[np.arange(len(row)), joint] = 0.0
    corrected = torque_nm.copy()
    np.add.at(corrected, row, (1.0 - phi)[:, np.newaxis] * missing)
    np.add.at(corrected, row + 1, phi[:, np.newaxis] * missing)
    return corrected


def _reversals(position: FloatArray, velocity: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the times at which joints reverse [rows], and the joints, each (events,).

    The time is the vertex of a parabola through the last three positions before the reversal; a
    spline would oscillate.
    """
    times: list[FloatArray] = [np.empty(0)]
    joints: list[IntArray] = [np.empty(0, dtype=np.int64)]
    for j, (q, v) in enumerate(zip(position.T, velocity.T, strict=True)):
        moving: IntArray = np.flatnonzero(np.abs(v) >= SLOW_RAD_S).astype(np.int64)
        last, first = moving[:-1], moving[1:]
        turns = (v[last] * v[first] < 0.0) & (first - last <= MOST_ROWS) & (last >= 2)
        last, first = last[turns], first[turns]
        step, bend = q[last] - q[last - 1], q[last] - 2.0 * q[last - 1] + q[last - 2]
        slows = step * bend < 0.0
        after = np.where(slows, -step / np.where(slows, bend, 1.0) - 0.5, np.inf)
        times.append(np.asarray(last + np.clip(after, 0.0, first - last), dtype=np.float64))
        joints.append(np.full(len(last), j, dtype=np.int64))
    return np.concatenate(times), np.concatenate(joints)


def _weights(phi: FloatArray) -> FloatArray:
    """Return weights (events, rows) whose weighted sum of torques is integral minus plain sum.

    The rows are those around a kink. The weights are the smallest that are exact for a parabola
    plus a cubic polynomial of (x - phi) that begins at phi. For a parabola the plain sum has no
    error. For (x - phi)^k from phi on, the error is B_{k+1}(1 - phi)/(k + 1).
    """
    rows, rest = np.arange(-BEFORE, AFTER + 1.0), 1.0 - phi
    bend = np.maximum(rows - phi[:, np.newaxis], 0.0)
    line = np.broadcast_to(rows, bend.shape)
    shapes = np.stack([np.ones_like(bend), line, line**2, bend, bend**2, bend**3], axis=1)
    missing = np.zeros((len(phi), 6, 1))
    missing[:, 3, 0] = (rest**2 - rest + 1.0 / 6.0) / 2.0
    missing[:, 4, 0] = (rest**3 - 1.5 * rest**2 + 0.5 * rest) / 3.0
    missing[:, 5, 0] = (rest**4 - 2.0 * rest**3 + rest**2 - 1.0 / 30.0) / 4.0
    turned = shapes.transpose(0, 2, 1)
    return np.asarray((turned @ np.linalg.solve(shapes @ turned, missing))[:, :, 0])
