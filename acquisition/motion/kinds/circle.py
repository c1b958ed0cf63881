"""Circular motion of the tool point at constant speed, as a periodic joint motion."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field, model_validator

from acquisition.motion.kinds.fourier import (
    FourierJoint,
    FourierMotion,
    periodic_samples,
    require_duration,
)
from acquisition.motion.kinds.motion import Motion, Poses, Position, Seconds, ToolSpeed
from acquisition.motion.samples import MotionSamples
from acquisition.signals.bins import to_bins
from config.arrays import FloatArray
from config.errors import ConfigError
from config.plausible import Plausible
from config.quantities import Place, Positive, Vector3
from config.robot.robot import RobotDescription
from dynamics.geometry.inverse_kinematics import follow_tool_path, pose_near_path, poses_on_lines

NEGLIGIBLE: Final = 1e-9
POINTS: Final = 512
MOST_HARMONICS: Final = 150


class CircleMotion(Motion):
    """Circle of the tool point at constant speed.

    The time of one turn is rounded to whole cycles, so that the speed can differ slightly.

    Attributes:
        centre_m: Centre of the circle in the base frame [m].
        radius_m: Radius of the circle [m].
        normal: Axis of the circle in the base frame; the turns are right-handed about it.
        speed_m_s: Speed of the tool point [m/s].
        near: Pose close to the start of the circle, one position per joint, base to flange [rad or
            m]. It selects the arm configuration and, if there are more than three joints, the
            constant orientation of the flange.
        periods: Number of turns for the measurement.
        transient_periods: Number of turns before the measurement, in which the transient decays.
        ramp_s: Time to speed up before the first turn, and to slow down after the last one [s].
    """

    kind: Literal["circle"]
    centre_m: Place
    radius_m: Annotated[Positive, Plausible(1e-5, 10.0, "m")]
    normal: Vector3 = (0.0, 0.0, 1.0)
    speed_m_s: ToolSpeed
    near: tuple[Position, ...] = Field(min_length=1)
    periods: Annotated[int, Field(ge=1, le=10_000)] = 15
    transient_periods: Annotated[int, Field(ge=0, le=1000)] = 2
    ramp_s: Seconds = 2.0

    @model_validator(mode="after")
    def _has_a_plane(self) -> CircleMotion:
        if not any(self.normal):
            raise ValueError("normal must not be zero")
        return self

    @property
    def period_s(self) -> float:
        """Time of one turn at exactly the requested speed [s]."""
        return 2.0 * math.pi * self.radius_m / self.speed_m_s

    def describe(self) -> str:
        """Return a description of the motion in one sentence."""
        return (
            f"{self.periods} turns of a circle of {2e3 * self.radius_m:g} mm diameter at"
            f" {self.speed_m_s:g} m/s, after {self.transient_periods} turns to settle."
        )

    def next_command(self, run: Path) -> tuple[object, ...]:
        """Return the command that evaluates the path error of a run on the circle."""
        return "tracking", run

    def chosen_poses(self, robot: RobotDescription, most: int) -> Poses | None:
        """Return the pose with the tool point in the centre; None if it cannot be reached."""
        start = self.points(np.zeros(1))[0]
        try:
            return poses_on_lines(robot, self.near, np.array([start, self.centre_m]))[1:]
        except ConfigError:
            return None

    def points(self, fraction: FloatArray) -> FloatArray:
        """Return points [m] at fractions of the circle's length, 0 to 1; (len(fraction), 3)."""
        normal = np.array(self.normal) / np.linalg.norm(self.normal)
        other = np.eye(3)[int(np.argmin(np.abs(normal)))]
        x = np.cross(other, normal)
        x /= np.linalg.norm(x)
        y = np.cross(normal, x)
        angle = 2.0 * math.pi * np.asarray(fraction)[:, np.newaxis]
        return np.asarray(
            np.array(self.centre_m) + self.radius_m * (np.cos(angle) * x + np.sin(angle) * y)
        )

    def turn_s(self, sample_period_s: float) -> float:
        """Return the time of one turn in whole cycles, at nearly the requested speed [s]."""
        return max(4, round(self.period_s / sample_period_s)) * sample_period_s

    def as_fourier(self, robot: RobotDescription, sample_period_s: float) -> FourierMotion:
        """Return the joint motion that moves the tool point along the circle.

        With three joints, the orientation of the flange is free; with more joints, the flange keeps
        its orientation at `near`.

        Raises:
            ConfigError: The circle cannot be reached, or the motion has too many harmonics for the
                sampling rate.
        """
        chain, near, rotation = pose_near_path(robot, self.near)
        period_s = self.turn_s(sample_period_s)
        position = follow_tool_path(chain, self.points(np.arange(POINTS) / POINTS), near, rotation)
        bins = to_bins(position, MOST_HARMONICS)
        significant = np.abs(bins[1:]).max(axis=1) > NEGLIGIBLE
        harmonics = int(np.flatnonzero(significant)[-1]) + 1
        if harmonics >= min(MOST_HARMONICS, round(period_s / sample_period_s) // 2):
            raise ConfigError(
                "the circle is too close to a singular pose for a smooth motion: move the"
                " circle, or make it smaller",
                code="RID-PATH-SINGULAR",
            )
        kept = 2.0 * bins[1 : harmonics + 1]
        joints = FourierJoint.for_each(
            joint=robot.joint_names, offset=bins[0].real, sine=-kept.imag.T, cosine=kept.real.T
        )
        return FourierMotion.from_attributes(self, kind="fourier", period_s=period_s, joints=joints)

    def _samples(self, robot: RobotDescription, sample_period_s: float) -> MotionSamples:
        require_duration(self.transient_periods + self.periods, self.period_s, self.ramp_s)
        turns = self.as_fourier(robot, sample_period_s)
        return periodic_samples(turns, robot, sample_period_s)
