"""`LoadSignal`: digital input of a drive that reports that a load is taken up or put down."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from config.model import ConfigModel
from config.plausible import Plausible

ShortS = Annotated[float, Field(ge=0.0), Plausible(0.0, 60.0, "s")]
DebounceS = Annotated[float, Field(ge=0.0), Plausible(0.0, 1.0, "s")]


class LoadSignal(ConfigModel):
    """Signal at which a change of the load begins, and the time in which it is expected.

    Attributes:
        joint: Joint whose drive has the input; its servo profile must state `digital_inputs`.
        bit: Number of the bit in object 60FDh (digital inputs).
        active: Level of the bit after the signal has come.
        debounce_s: Time for which the input must have this level without interruption.
        early_s: Longest time by which the signal may come before `at_s`.
        late_s: Longest time by which the signal may come after `at_s`.
        missed: Reaction if the signal does not come in this time: `stop` stops the robot on its
            path; `unloaded` goes on with the load unchanged, and reports it.
        outside: Reaction to a signal that comes earlier or later: `stop`, or `report`, with which
            the load follows the signal.
    """

    joint: str = Field(min_length=1)
    bit: int = Field(ge=0, le=31)
    active: Literal["high", "low"] = "high"
    debounce_s: DebounceS
    early_s: ShortS
    late_s: ShortS
    missed: Literal["stop", "unloaded"]
    outside: Literal["stop", "report"] = "stop"
