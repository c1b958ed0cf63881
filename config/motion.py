"""Motion files: what the robot is to do, before a single sample of it is computed."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from config.model import ConfigModel
from config.robot import Positive


class FourierJoint(ConfigModel):
    """One joint's Fourier series (2.30): offset and, per harmonic, sine and cosine amplitudes.

    `sine[k-1]` and `cosine[k-1]` belong to harmonic k; rad for revolute joints, m for prismatic.
    """

    joint: str
    offset: float = 0.0
    sine: tuple[float, ...] = Field(min_length=1, max_length=100)
    cosine: tuple[float, ...] = Field(min_length=1, max_length=100)

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


Motion = Annotated[FourierMotion | MultipointMotion, Field(discriminator="kind")]
