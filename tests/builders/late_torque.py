"""Recordings of the bundled arm with delayed torques."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.recording.recording import Recording
from config.load import LoadedCell
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from identification.validation.robot_terms import with_friction

CLASSICAL: tuple[FrictionTerm, ...] = ("coulomb", "viscous")
FOUND_M = (2.8e-4, 2.8e-4, 3.4e-4)
"""Presliding distances of the axes that fit the simulated robot best [rad]."""
MOTION = FourierMotion(
    kind="fourier",
    robot="ir361",
    period_s=10.0,
    periods=8,
    ramp_s=4.0,
    joints=(
        FourierJoint(
            joint="axis1",
            offset=0.5,
            sine=(-0.62, 0.65, 0.19, -0.22, 0.39),
            cosine=(0.56, 0.24, -0.41, -0.59, -0.07),
        ),
        FourierJoint(
            joint="axis2",
            offset=-0.2,
            sine=(-0.58, 0.17, 0.09, -0.32, -0.23),
            cosine=(-0.16, -0.28, 0.19, -0.03, 0.49),
        ),
        FourierJoint(
            joint="axis3",
            offset=0.54,
            sine=(-0.74, -0.04, 0.18, -0.5, -0.41),
            cosine=(-0.35, 0.07, -0.76, 0.28, -0.1),
        ),
    ),
)
"""A motion of five harmonics designed by `rid-daq design`."""


def robot_of(cell: LoadedCell, terms: tuple[FrictionTerm, ...] = CLASSICAL) -> RobotDescription:
    return with_friction(cell.robot, [terms] * 3)


def late(recording: Recording, delay_ms: Sequence[float]) -> Recording:
    """Return a recording with the torque of each joint delayed by its value in `delay_ms`."""
    torque = [
        CubicSpline(recording.time_s, column)(recording.time_s - 1e-3 * by)
        for column, by in zip(recording.torque_nm.T, delay_ms, strict=True)
    ]
    return replace(recording, torque_nm=np.transpose(torque))
