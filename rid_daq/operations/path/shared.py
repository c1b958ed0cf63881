"""Fields that several operations on paths have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from rid_daq.requests.option import FILES, Option

ModelFile = Annotated[
    Path,
    Field(description="Model file that `identify` wrote."),
    Option(metavar="MODEL", file="input"),
]

Temperature = Annotated[
    str | None,
    Field(
        description="Temperature of the joints, if the friction of the model depends on it: degrees"
        " Celsius, one value or one a joint; `warm` (as the motion heats them) or `cold` for a"
        " model without thermometers."
    ),
    Option(metavar="°C,..."),
]

LoopsFile = Annotated[
    Path,
    Field(description="File of velocity loops that `loop` wrote."),
    Option(metavar="LOOPS", file="input"),
]

FeedforwardOutput = Annotated[
    Path,
    Field(description="Feedforward file to write."),
    Option(short="o", metavar="FEEDFORWARD", group=FILES, file="output", endings=(".json",)),
]
