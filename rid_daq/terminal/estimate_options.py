"""Options that commands on estimates share: what is used of a recording, what is sure enough.

A command's help is shown from its options alone, so nothing here imports numerics.
"""

from __future__ import annotations

from typing import Annotated

import typer

from config.ranges import least
from identification.choices import Millimetres, Share
from rid_daq.terminal.plausible_option import plausible_as

MassLimit = Annotated[
    float,
    typer.Option(
        "--mass-limit",
        min=least(Share),
        callback=plausible_as(Share),
        help="2σ of the mass at most [%].",
    ),
]

CentreLimit = Annotated[
    float,
    typer.Option(
        "--centre-limit",
        min=least(Millimetres),
        callback=plausible_as(Millimetres),
        help="2σ of the centre at most [mm].",
    ),
]

InertiaLimit = Annotated[
    float,
    typer.Option(
        "--inertia-limit",
        min=least(Share),
        callback=plausible_as(Share),
        help="2σ of inertia at most, of that about the flange [%].",
    ),
]

ResidualLimit = Annotated[
    float,
    typer.Option(
        "--residual-limit",
        min=least(Share),
        callback=plausible_as(Share),
        help="Residual of an axis' torque at most [%].",
    ),
]
