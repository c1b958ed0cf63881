"""`EstimationOptions`: the options of an estimate."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Literal

from pydantic import ConfigDict

from config.arrays import FloatArray
from config.ranges import Ranged
from identification.choices import BAND_HZ, STANDSTILL_RAD_S, BandHz, StandstillRadS
from identification.model.options import ModelOptions

Weighting = Literal["ml", "ls", "huber"]
"""Row weights: one over the noise, equal, or one over the noise with outliers down-weighted."""

Prior = tuple[FloatArray, FloatArray]
"""Values and standard deviations of the standard parameters; infinite if unknown."""


@dataclass(frozen=True, eq=False)
class EstimationOptions(Ranged):
    """Options of an estimate, for averaged periods and for smoothed recordings.

    Attributes:
        model: Terms of the model; by default those of the robot file.
        weighting: Weight of the rows: one over their noise ("ml"), equal ("ls"), or one over their
            noise with outliers down-weighted ("huber").
        prior: (values, sigmas). Prior knowledge of the standard parameters (Bayesian estimate).
        band_hz: Highest frequency used [Hz]; for smoothed recordings their cut-off is used instead.
        standstill_rad_s: Below this speed a joint's friction is free, or its equation is left out;
            with 0, sign(v) is used everywhere [rad/s or m/s]. For a slow joint a tenth of its speed
            limit is used if it is smaller.
    """

    __pydantic_config__: ClassVar = ConfigDict(arbitrary_types_allowed=True)

    model: ModelOptions = field(default_factory=ModelOptions)
    weighting: Weighting = "ml"
    prior: Prior | None = None
    band_hz: BandHz = BAND_HZ
    standstill_rad_s: StandstillRadS = STANDSTILL_RAD_S
