"""A circle of the tool point at constant speed, as a periodic joint motion."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from acquisition.signals.bins import to_bins
from config.arrays import FloatArray
from config.errors import ConfigError
from config.motion.motion import CircleMotion, FourierJoint, FourierMotion
from config.robot.robot import RobotDescription
from dynamics.geometry.inverse_kinematics import follow
from dynamics.geometry.kinematics import Chain, link_transforms

NEGLIGIBLE: Final = 1e-9
POINTS: Final = 512
MOST_HARMONICS: Final = 150


def circle_points(motion: CircleMotion, share: FloatArray) -> FloatArray:
    """Return the circle's points [m] at shares of its length, 0 to 1; shape (len(share), 3)."""
    normal = np.array(motion.normal) / np.linalg.norm(motion.normal)
    other = np.eye(3)[int(np.argmin(np.abs(normal)))]
    x = np.cross(other, normal)
    x /= np.linalg.norm(x)
    y = np.cross(normal, x)
    angle = 2.0 * math.pi * np.asarray(share)[:, np.newaxis]
    return np.asarray(
        np.array(motion.centre_m) + motion.radius_m * (np.cos(angle) * x + np.sin(angle) * y)
    )


def circle_period_s(motion: CircleMotion, sample_period_s: float) -> float:
    """Return the time of one turn [s]: a whole number of cycles, at nearly the speed asked for."""
    return max(4, round(motion.period_s / sample_period_s)) * sample_period_s


def circle_motion(
    motion: CircleMotion, robot: RobotDescription, sample_period_s: float
) -> FourierMotion:
    """Return the joint motion that leads the tool point along the circle.

    The arm's orientation stays free where it has three joints; with more, the flange keeps the
    orientation that it has at `near`.

    Raises
    ------
    ConfigError
        The circle cannot be reached, or has more harmonics than can be sampled.
    """
    n = len(robot.joints)
    if len(motion.near) != n:
        raise ConfigError(f"near has {len(motion.near)} values, robot {robot.name!r} {n} joints")
    chain = Chain.from_description(robot)
    near = np.array(motion.near, dtype=float)
    rotation = None if n == 3 else link_transforms(chain, near[np.newaxis])[0, -1][:3, :3]
    period_s = circle_period_s(motion, sample_period_s)
    position = follow(chain, circle_points(motion, np.arange(POINTS) / POINTS), near, rotation)
    bins = to_bins(position, MOST_HARMONICS)
    significant = np.abs(bins[1:]).max(axis=1) > NEGLIGIBLE
    harmonics = int(np.flatnonzero(significant)[-1]) + 1
    if harmonics >= min(MOST_HARMONICS, round(period_s / sample_period_s) // 2):
        raise ConfigError(
            "the circle comes too near a singular pose for a smooth motion: move it, or make it"
            " smaller"
        )
    kept = 2.0 * bins[1 : harmonics + 1]
    return FourierMotion(
        kind="fourier",
        robot=motion.robot,
        period_s=period_s,
        periods=motion.periods,
        transient_periods=motion.transient_periods,
        ramp_s=motion.ramp_s,
        joints=tuple(
            FourierJoint(
                joint=joint.name,
                offset=float(bins[0, j].real),
                sine=tuple((-kept[:, j].imag).tolist()),
                cosine=tuple(kept[:, j].real.tolist()),
            )
            for j, joint in enumerate(robot.joints)
        ),
    )
