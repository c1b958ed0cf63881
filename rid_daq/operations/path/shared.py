"""Request fields that several operations on paths share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from rid_daq.requests.option import FILES, Option

ModelFile = Annotated[
    Path,
    Field(description="Model file of `identify`."),
    Option(metavar="MODEL", file="input"),
]

Temperature = Annotated[
    str | None,
    Field(
        description="Temperature of the joints, if the friction of the model depends on it:"
        " degrees Celsius, one value or one per joint. For a model that computes the warming of"
        " the joints from their friction: `warm` (after many repetitions of the motion) or `cold`"
        " (after a long rest)."
    ),
    Option(metavar="°C,..."),
]

LoopsFile = Annotated[
    Path,
    Field(description="Loop file of `loop`."),
    Option(metavar="LOOPS", file="input"),
]

FeedforwardOutput = Annotated[
    Path,
    Field(description="Feedforward file to write."),
    Option(short="o", metavar="FEEDFORWARD", group=FILES, file="output", endings=(".json",)),
]
