"""Periodic motion followed by the same path backwards in time, to measure only friction."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from acquisition.motion.kinds.fourier import (
    FourierJoint,
    FourierMotion,
    join_periodic_motions,
    require_duration,
)
from acquisition.motion.kinds.motion import Motion, Seconds
from acquisition.motion.samples import MotionSamples
from config.robot.robot import RobotDescription


class ReversedMotion(Motion):
    """Periodic motion followed by the same path backwards in time, to measure only friction.

    Attributes:
        period_s: Duration of one period [s].
        periods: Number of periods in each direction for the measurement.
        transient_periods: Number of periods in each direction before the measurement, in which the
            transient decays.
        ramp_s: Time to speed up before each direction, and to slow down after it [s].
        dwell_s: Rest between the two directions [s].
        joints: The Fourier series, one per joint of the robot, in any order.
    """

    kind: Literal["reversed"]
    period_s: Seconds
    periods: Annotated[int, Field(ge=2, le=5000)] = 8
    transient_periods: Annotated[int, Field(ge=0, le=1000)] = 1
    ramp_s: Seconds = 4.0
    dwell_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.5
    joints: tuple[FourierJoint, ...] = Field(min_length=1)

    def describe(self) -> str:
        """Return a description of the motion in one sentence."""
        return f"{self.forward().describe()[:-1]}, and then the same path backwards."

    def next_command(self, run: Path) -> tuple[object, ...]:
        """Return the command that evaluates the friction in a run."""
        return "friction", run

    def forward(self) -> FourierMotion:
        """Return the periodic motion q(t)."""
        return FourierMotion.from_attributes(self, kind="fourier")

    def reverse(self) -> FourierMotion:
        """Return the periodic motion backwards in time, q(-t): sine coefficients change sign."""
        joints = tuple(
            joint.model_copy(update={"sine": tuple(-value for value in joint.sine)})
            for joint in self.joints
        )
        return self.forward().model_copy(update={"joints": joints})

    def _samples(self, robot: RobotDescription, sample_period_s: float) -> MotionSamples:
        require_duration(self.transient_periods + self.periods, self.period_s, self.ramp_s, parts=2)
        parts = [self.forward(), self.reverse()]
        return join_periodic_motions(parts, robot, sample_period_s, self.dwell_s)
