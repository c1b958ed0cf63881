"""Motion files: what the robot is to do, before a single sample of it is computed."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from config.model import ConfigModel
from config.motion.path_motion import JointPathMotion, JointTableMotion, PathMotion
from config.robot.robot import Positive, Vector3


class FourierJoint(ConfigModel):
    """One joint's Fourier series (2.30): offset and, per harmonic, sine and cosine amplitudes.

    `sine[k-1]` and `cosine[k-1]` belong to harmonic k; rad for revolute joints, m for prismatic.
    """

    joint: str
    offset: float = 0.0
    sine: tuple[float, ...] = Field(min_length=1, max_length=1000)
    cosine: tuple[float, ...] = Field(min_length=1, max_length=1000)

    @model_validator(mode="after")
    def _same_length(self) -> FourierJoint:
        if len(self.sine) != len(self.cosine):
            raise ValueError(
                f"sine has {len(self.sine)} harmonics, cosine {len(self.cosine)}: give the same"
            )
        return self


class FourierMotion(ConfigModel):
    """Periodic excitation: `transient_periods` to settle, then `periods` that count."""

    kind: Literal["fourier"]
    robot: str
    period_s: Positive
    periods: Annotated[int, Field(ge=1, le=10_000)] = 16
    transient_periods: Annotated[int, Field(ge=0, le=1000)] = 1
    ramp_s: Positive = 4.0
    joints: tuple[FourierJoint, ...] = Field(min_length=1)


class MultipointMotion(ConfigModel):
    """Smooth point-to-point motion through random poses: the validation motion.

    The points are drawn from `seed` inside the joint limits shrunk by `range_fraction`; every
    move takes the time that the slowest joint needs at `speed_fraction` of its limits.
    """

    kind: Literal["multipoint"]
    robot: str
    points: Annotated[int, Field(ge=2, le=1000)] = 20
    seed: Annotated[int, Field(ge=0)]
    range_fraction: Annotated[float, Field(gt=0.0, le=1.0)] = 0.8
    speed_fraction: Annotated[float, Field(gt=0.0, le=1.0)] = 0.7
    dwell_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.1


class SpeedRuns(ConfigModel):
    """The speeds of one joint, each run from `low` to `high` and back; rad (m), per second."""

    joint: str
    low: float
    high: float
    speeds: tuple[Positive, ...] = Field(min_length=1, max_length=50)

    @model_validator(mode="after")
    def _ordered(self) -> SpeedRuns:
        if self.low >= self.high:
            raise ValueError(f"low {self.low} must be below high {self.high}")
        return self


class ConstantVelocityMotion(ConfigModel):
    """Runs at constant speeds, one joint at a time, to measure friction alone.

    The other joints hold `pose` (one value a joint, base to flange). Every speed is run forwards
    and backwards over the same stretch, around the middle of `low` and `high` and no longer than
    `longest_run_s`, `repeats` times. Speeds change smoothly, within `acceleration_fraction` of the
    joint's limit.
    """

    kind: Literal["constant_velocity"]
    robot: str
    pose: tuple[float, ...] = Field(min_length=1)
    joints: tuple[SpeedRuns, ...] = Field(min_length=1)
    acceleration_fraction: Annotated[float, Field(gt=0.0, le=1.0)] = 0.5
    longest_run_s: Annotated[float, Field(ge=1.0, le=600.0)] = 8.0
    repeats: Annotated[int, Field(ge=1, le=100)] = 1
    dwell_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.2


class ReversedMotion(ConfigModel):
    """A periodic motion, and then the same path backwards in time, to measure friction alone.

    Both parts have `transient_periods` to settle and `periods` that count; between them the robot
    rests for `dwell_s`.
    """

    kind: Literal["reversed"]
    robot: str
    period_s: Positive
    periods: Annotated[int, Field(ge=2, le=5000)] = 8
    transient_periods: Annotated[int, Field(ge=0, le=1000)] = 1
    ramp_s: Positive = 4.0
    dwell_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.5
    joints: tuple[FourierJoint, ...] = Field(min_length=1)

    def there(self) -> FourierMotion:
        """Return the periodic motion q(t)."""
        return FourierMotion(
            kind="fourier",
            robot=self.robot,
            period_s=self.period_s,
            periods=self.periods,
            transient_periods=self.transient_periods,
            ramp_s=self.ramp_s,
            joints=self.joints,
        )

    def back(self) -> FourierMotion:
        """Return the periodic motion q(-t): its sines have the other sign."""
        joints = tuple(
            joint.model_copy(update={"sine": tuple(-value for value in joint.sine)})
            for joint in self.joints
        )
        return self.there().model_copy(update={"joints": joints})


class MultisineJoint(ConfigModel):
    """How one joint is excited: its speed is a multisine, on top of a slow sine.

    `velocity` is the RMS speed of the multisine [rad/s or m/s], 0 for a joint that is not measured;
    `slow_amplitude` the slow sine's amplitude [rad or m] about `offset`.
    """

    joint: str
    offset: float = 0.0
    velocity: Annotated[float, Field(ge=0.0)]
    slow_amplitude: Annotated[float, Field(ge=0.0)] = 0.0


class MultisineMotion(ConfigModel):
    """Multisines on the joints' speeds, to measure how the velocity loops answer.

    The excited lines are harmonics of `period_s` between `lowest_hz` and `highest_hz`, shared out
    among the joints in turn, so that each line belongs to one joint: all odd ones (`odd`), odd ones
    of which every fourth at random stays empty and shows distortion (`random_odd`), or all of them
    (`full`). Each of `realisations` has phases of its own, drawn at random, and has
    `transient_periods` to settle before `periods` that count; `schroeder` phases are always the
    same and make one realisation. From either start phases are improved for a low crest factor. The
    slow sine is harmonic 1.
    """

    kind: Literal["multisine"]
    robot: str
    period_s: Positive
    lowest_hz: Positive
    highest_hz: Positive
    grid: Literal["odd", "random_odd", "full"] = "random_odd"
    phases: Literal["random", "schroeder"] = "random"
    seed: Annotated[int, Field(ge=0)] = 0
    realisations: Annotated[int, Field(ge=1, le=100)] = 4
    periods: Annotated[int, Field(ge=2, le=1000)] = 4
    transient_periods: Annotated[int, Field(ge=0, le=100)] = 1
    ramp_s: Positive = 2.0
    joints: tuple[MultisineJoint, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _band(self) -> MultisineMotion:
        if self.lowest_hz >= self.highest_hz:
            raise ValueError(f"lowest_hz {self.lowest_hz} must be below highest_hz")
        if self.lowest_hz * self.period_s < 2.0 - 1e-9:
            raise ValueError("lowest_hz must be at least two harmonics: the first is the slow sine")
        if self.phases == "schroeder" and self.realisations > 1:
            raise ValueError(
                f"schroeder phases are the same in all {self.realisations} realisations: set"
                " realisations to 1, or phases to random"
            )
        if not any(joint.velocity > 0.0 for joint in self.joints):
            raise ValueError("no joint has a velocity: nothing is excited")
        return self


class CircleMotion(ConfigModel):
    """The tool point goes round a circle at constant speed, `periods` times after settling.

    `centre_m` and `normal` are in the base frame. `near` (one value a joint) chooses among the ways
    in which the arm reaches the circle's start, and the orientation that the flange keeps. The time
    of a turn is rounded to whole cycles, so that the speed may differ by a little.
    """

    kind: Literal["circle"]
    robot: str
    centre_m: Vector3
    radius_m: Positive
    normal: Vector3 = (0.0, 0.0, 1.0)
    speed_m_s: Positive
    near: tuple[float, ...] = Field(min_length=1)
    periods: Annotated[int, Field(ge=1, le=10_000)] = 15
    transient_periods: Annotated[int, Field(ge=0, le=1000)] = 2
    ramp_s: Positive = 2.0

    @model_validator(mode="after")
    def _has_a_plane(self) -> CircleMotion:
        if not any(self.normal):
            raise ValueError("normal must not be zero")
        return self

    @property
    def period_s(self) -> float:
        """The time of one turn at exactly the speed asked for [s]."""
        return 2.0 * math.pi * self.radius_m / self.speed_m_s


AnyMotion = (
    FourierMotion
    | MultipointMotion
    | ConstantVelocityMotion
    | ReversedMotion
    | MultisineMotion
    | CircleMotion
    | PathMotion
    | JointPathMotion
    | JointTableMotion
)
Motion = Annotated[AnyMotion, Field(discriminator="kind")]
