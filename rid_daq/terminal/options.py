"""Options and arguments that several commands have, without what they are used for.

A command's help is shown from its options alone, so nothing here imports numerics.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from config import ranges
from config.ranges import least, most
from rid_daq.terminal.choices import DEFAULT_LISTEN as DEFAULT_LISTEN
from rid_daq.terminal.choices import DEFAULT_RUNS as DEFAULT_RUNS
from rid_daq.terminal.console import JSON_HELP, SERVICE_HELP

AsJson = Annotated[bool, typer.Option("--json", help=JSON_HELP)]
"""The option of every command."""

Service = Annotated[str | None, typer.Option("--service", metavar="ADDRESS", help=SERVICE_HELP)]
"""The option of every command that a service can do."""

CellName = Annotated[str, typer.Argument(metavar="CELL", help="A bundled name or a cell file.")]
"""The argument of every command that works on a cell."""

PACE_HELP = (
    "A simulated cell at so many times the clock's pace, and never late: time waits for whoever is."
)

Pace = Annotated[
    float | None,
    typer.Option(
        min=least(ranges.Pace),
        max=most(ranges.Pace),
        metavar="TIMES",
        help=f"{PACE_HELP} As fast as it can if not given.",
    ),
]
"""An option of the commands that move a cell."""

Seed = Annotated[
    int,
    typer.Option(
        min=least(ranges.Seed), max=most(ranges.Seed), help="Of a simulated cell's noise."
    ),
]
"""An option of the commands that move a cell."""


RunsFolder = Annotated[
    Path, typer.Option("--runs", help="The folder that holds the run folders.", show_default=True)
]
"""The `--runs` option that every command with run folders has."""


Live = Annotated[
    bool, typer.Option("--live", help="Show the motion in a browser, with a stop button.")
]

Listen = Annotated[
    str,
    typer.Option(
        metavar="ADDRESS:PORT",
        help="Where the live page is served; an address that other machines can reach needs --token"
        " and --certificate.",
    ),
]

Token = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="The live page's secret, instead of a new one each time."),
]

Certificate = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Certificate and key (PEM): the live page by TLS."),
]

Practise = Annotated[
    bool,
    typer.Option(
        "--practise", help="Ask on a simulated cell too what is asked on a real one, to practise."
    ),
]
"""The option of the commands that ask before they move a robot."""

WithoutAxisTest = Annotated[
    bool,
    typer.Option(
        "--without-axis-test",
        help="Move a real robot though `rid-daq axes` has not passed since its cell or robot file"
        " changed; the run says so.",
    ),
]
"""The option that every command has that moves a real robot by itself."""
