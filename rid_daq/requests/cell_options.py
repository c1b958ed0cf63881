"""Request fields that several operations on a cell share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import Field

from config.ranges import Pace, Seed
from rid_daq.requests.option import Option
from rid_daq.requests.request import Request
from rid_daq.terminal.choices import DEFAULT_LISTEN

BEFORE: Final = "Before it moves"
SIMULATED: Final = "Simulated cells"
LIVE: Final = "Live page"

Cleared = Annotated[
    bool,
    Field(
        description="Confirm that the cell is clear of people and that the emergency stop is at"
        " hand. A real robot needs this option if no person can be asked."
    ),
    Option(group=BEFORE, flag="i-have-cleared-the-cell", owned=True),
]

Practise = Annotated[
    bool,
    Field(description="Ask the same questions on a simulated cell as on a real one."),
    Option(group=BEFORE),
]

AxisTest = Annotated[
    Literal["required", "waived"],
    Field(
        description="Waive the axis test: move a real robot although `rid-daq axes` has not"
        " passed since its cell or robot file changed. The run records this."
    ),
    Option(group=BEFORE, flag="without-axis-test", value="waived"),
]

OfFile = Annotated[
    str | None, Field(description="Name of the run; the motion file's name if not set.")
]


SimulatedPace = Annotated[
    Pace | None,
    Field(
        description="Run a simulated cell at N times real time; simulated time waits for slow"
        " processes."
    ),
    Option(group=SIMULATED, metavar="N"),
]

SimulatedPayload = Annotated[
    str | None,
    Field(description="Payload of a simulated robot: its name in the plant file."),
]


class Simulation(Request):
    """Options of a simulated cell that the operation starts."""

    realtime: Annotated[
        bool,
        Field(description="Run a simulated cell in real time, instead of as fast as possible."),
        Option(group=SIMULATED),
    ] = False
    pace: SimulatedPace = None
    seed: Annotated[
        Seed, Field(description="Random seed of the simulated noise."), Option(group=SIMULATED)
    ] = 0
    payload: Annotated[
        SimulatedPayload, Option(group=SIMULATED, metavar="NAME", flag="mounted")
    ] = None


class Live(Request):
    """Options of the live page."""

    wanted: Annotated[
        bool,
        Field(description="Show the motion in a browser, with a stop button."),
        Option(group=LIVE, flag="live"),
    ] = False
    listen: Annotated[
        str,
        Field(
            description="Address of the live page; an address that other computers can reach"
            " needs --token and --certificate."
        ),
        Option(group=LIVE, metavar="ADDRESS:PORT", needs="wanted"),
    ] = DEFAULT_LISTEN
    token: Annotated[
        Path | None,
        Field(
            description="File with the secret of the live page; a new secret for each run if"
            " not set."
        ),
        Option(group=LIVE, metavar="FILE", needs="wanted"),
    ] = None
    certificate: Annotated[
        Path | None,
        Field(description="Certificate and key (PEM) to serve the live page by TLS."),
        Option(group=LIVE, metavar="FILE", needs="wanted"),
    ] = None
