"""`TimedFault`: time at which a fault of a simulated cell begins."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field, model_validator

from config.model import ConfigModel

LONGEST_S: Final = 604_800.0
MOST: Final = 1_000_000_000
"""Largest count in a script; `LONGEST_S` is the latest time and the longest duration [s]."""

Duration = Annotated[float, Field(gt=0.0, le=LONGEST_S)]
Count = Annotated[int, Field(ge=1, le=10_000_000)]


class TimedFault(ConfigModel):
    """Start of a fault.

    Attributes:
        at_s: Time of the start since the cell was started [s]. Give at most one of `at_s` and
            `at_cycle`; without both, the fault starts at once.
        at_cycle: Number of the SYNC at which the fault starts, counted since the drives were
            enabled.
    """

    at_s: Annotated[float, Field(ge=0.0, le=LONGEST_S)] | None = None
    at_cycle: Annotated[int, Field(ge=1, le=MOST)] | None = None

    @model_validator(mode="after")
    def _check_start(self) -> TimedFault:
        if self.at_s is not None and self.at_cycle is not None:
            raise ValueError("at_s and at_cycle are both given; remove one")
        return self
