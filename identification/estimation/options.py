"""`EstimationOptions`: what a person may choose about an estimate."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Literal

from pydantic import ConfigDict

from config.arrays import FloatArray
from config.ranges import Ranged
from identification.choices import BAND_HZ, STANDSTILL_RAD_S, BandHz, StandstillRadS
from identification.model.options import ModelOptions

Weighting = Literal["ml", "ls", "huber"]
"""Rows weighted by one over their noise, all alike, or by noise with outliers held down."""

Prior = tuple[FloatArray, FloatArray]
"""Values and standard deviations of the model's standard parameters; infinite for no knowledge."""


@dataclass(frozen=True, eq=False)
class EstimationOptions(Ranged):
    """How to estimate; the same for averaged periods and for smoothed recordings.

    Attributes:
        model: Terms of the model; what the robot file says by default.
        weighting: Rows over their noise; all alike; over their noise with outliers held down.
        prior: (values, sigmas). Knowledge of the standard parameters (Bayesian estimate).
        band_hz: Highest frequency used [Hz]; of smoothed recordings their cut-off counts instead.
        standstill_rad_s: Below this speed a joint's friction is left free, or its equation out; 0
            trusts sign(v) everywhere [rad/s or m/s]. Of a slow joint a tenth of its speed limit, if
            that is less.
    """

    __pydantic_config__: ClassVar = ConfigDict(arbitrary_types_allowed=True)

    model: ModelOptions = field(default_factory=ModelOptions)
    weighting: Weighting = "ml"
    prior: Prior | None = None
    band_hz: BandHz = BAND_HZ
    standstill_rad_s: StandstillRadS = STANDSTILL_RAD_S
