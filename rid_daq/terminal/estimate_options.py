"""Options that commands on estimates share: what is used of a recording, what is sure enough.

A command's help is shown from its options alone, so nothing here imports numerics.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, get_args

import typer

from config.ranges import least
from config.robot.friction_terms import FrictionTerm
from identification.choices import BandHz, Millimetres, Share, StandstillRadS
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

Band = Annotated[
    float,
    typer.Option(
        "--band",
        min=least(BandHz),
        callback=plausible_as(BandHz),
        help="Highest frequency used [Hz].",
    ),
]

Standstill = Annotated[
    float,
    typer.Option(
        "--standstill",
        min=least(StandstillRadS),
        callback=plausible_as(StandstillRadS),
        help="Lowest speed used for friction [rad/s].",
    ),
]

Rotors = Annotated[bool, typer.Option(help="Rotors with their coupling.")]

FrictionTerms = Annotated[
    str | None,
    typer.Option(
        "--friction-terms",
        metavar="TERM,...",
        help=f"Friction of every joint: {', '.join(get_args(FrictionTerm))}.",
    ),
]

ModelFile = Annotated[Path, typer.Option(metavar="MODEL", help="A model by `identify`.")]

LoopsFile = Annotated[Path, typer.Option(metavar="LOOPS", help="Velocity loops by `loop`.")]

Temperature = Annotated[
    str | None,
    typer.Option(
        "--temperature",
        metavar="°C,...",
        help="How warm the joints are, where the model's friction depends on it: degrees Celsius,"
        " one or one a joint; `warm` (as the motion makes them) or `cold` without thermometers.",
    ),
]
