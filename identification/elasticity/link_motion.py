"""`solve_links`: the periodic motion of the links that belongs to a measured motion of the motors.

The links satisfy q = theta - tau_link(q, q', q'', theta', theta'') / (k + s d), with s = j omega on
the DFT bins. The equation is solved by fixed-point iteration. Each step is divided by the factor
1 + s^2 M / (k + s d) with the mean inertia M, so that the iteration also converges near the
resonance of links on locked motors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from acquisition.signals.bins import Bins, from_bins
from config.arrays import FloatArray
from identification.elasticity.elastic_arm import ElasticArm, ElasticMotion

MOST_STEPS: Final = 25
SETTLED_RAD: Final = 1e-11


@dataclass(frozen=True, eq=False)
class Gears:
    """Parameters of an arm with elastic gears.

    Attributes:
        stiffness: Shape (n,). k [N m/rad or N/m].
        damping: Shape (n,). d [N m s/rad or N s/m].
        rotor, body: See `ElasticArm`.
    """

    stiffness: FloatArray
    damping: FloatArray
    rotor: FloatArray
    body: FloatArray


class LinkMotion(NamedTuple):
    """Motion of the links.

    Attributes:
        motion: The motion in one period.
        deflection: Shape (H + 1, n). Bins of theta - q.
        torque: Shape (H + 1, n). Bins of the torques that the gears transmit.
        is_settled: True if the last step of the fixed point was below `SETTLED_RAD`; False if the
            steps ended before.
    """

    motion: ElasticMotion
    deflection: Bins
    torque: Bins
    is_settled: bool


def solve_links(
    arm: ElasticArm,
    gears: Gears,
    theta: Bins,
    period_s: float,
    rows: int,
    inertia: FloatArray,
    start: Bins | None = None,
) -> LinkMotion:
    """Return the links' motion for a motion of the motors.

    Args:
        theta: Shape (H + 1, n). Bins of the motors' positions [rad or m].
        rows: Number of samples of the returned motion, enough for the products of harmonics.
        inertia: Shape (n,). Mean inertia of the links about each joint.
        start: Shape (H + 1, n). Deflection to start from.
    """
    s = 2j * math.pi / period_s * np.arange(len(theta))[:, np.newaxis]
    gear = gears.stiffness + s * gears.damping
    speed = 1.0 / (1.0 + s**2 * inertia / gear)
    motor_v, motor_a = from_bins(theta * s, rows), from_bins(theta * s**2, rows)
    bent = start.copy() if start is not None and np.isfinite(start).all() else 0.0 * theta
    is_settled = False
    for _ in range(MOST_STEPS):
        link = theta - bent
        motion = ElasticMotion(
            from_bins(link, rows),
            from_bins(link * s, rows),
            from_bins(link * s**2, rows),
            motor_v,
            motor_a,
        )
        tau = arm.link_torque(motion, gears.body, gears.rotor)
        torque = np.asarray(np.fft.rfft(tau, axis=0)[: len(theta)] / rows)
        step = speed * (torque / gear - bent)
        bent = bent + step
        is_settled = bool(np.abs(step).sum(axis=0).max() < SETTLED_RAD)
        if is_settled:
            break
    return LinkMotion(motion, bent, torque, is_settled)
