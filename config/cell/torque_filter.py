"""`ButterworthFilter`: analog filter in front of the drives' torque converters or of a plate's."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from config.model import ConfigModel
from config.plausible import Plausible
from config.quantities import Positive


class ButterworthFilter(ConfigModel):
    """An analog anti-alias filter in front of a converter.

    Attributes:
        order: Number of poles.
        cutoff_hz: Frequency of -3 dB.
    """

    order: Annotated[int, Field(ge=1, le=12)]
    cutoff_hz: Annotated[Positive, Plausible(0.5, 2e4, "Hz")]
