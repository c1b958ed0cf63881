"""`rid-daq jog`: move a cell's robot by hand, while a key is held."""

from __future__ import annotations

from typing import Annotated

import typer

from config.ranges import JogPercent, least, most
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import here_or_there
from rid_daq.terminal.choices import JOG_PERCENT
from rid_daq.terminal.console import Console
from rid_daq.terminal.options import (
    DEFAULT_RUNS,
    AsJson,
    CellName,
    Cleared,
    Practise,
    Realtime,
    RunsFolder,
    Seed,
    Service,
)


def jog(
    cell: CellName,
    home: Annotated[
        bool, typer.Option("--home", help="To the home pose of the cell file, and nowhere else.")
    ] = False,
    speed: Annotated[
        float,
        typer.Option(
            min=least(JogPercent),
            max=most(JogPercent),
            metavar="PERCENT",
            help="Of each joint's velocity limit; the tool point never goes beyond 250 mm/s.",
        ),
    ] = JOG_PERCENT,
    label: Annotated[str, typer.Option(help="What to call the run.")] = "jog",
    realtime: Realtime = False,
    seed: Seed = 0,
    cleared: Cleared = False,
    practise: Practise = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Move one joint at a time while a key is held; let go, and the robot stops.

    Digits choose a joint, + and - move it while they are held, h goes to the home pose, q ends. The
    way is looked at before it is driven: it ends before a joint's limit, and before two bodies come
    too close. A key counts as held from its second repeat on, and for 0.2 s after the last; the
    process that runs the cycle asks for it in every cycle, so that the robot also stops where this
    program is suspended, and is switched off where it is killed. After a minute without a key the
    power is taken away. Ctrl-C is a quick stop. It is not an enabling device.
    """
    from rid_daq.commissioning.jog_job import JogRequest
    from rid_daq.performers.jog import perform
    from rid_daq.session.cells import Simulation

    request = JogRequest(
        cell=cell,
        runs=runs,
        home=home,
        speed_percent=speed,
        label=label,
        simulation=Simulation(realtime=realtime, seed=seed),
        cleared=cleared,
        practise=practise,
    )
    here_or_there(service, JobKind.JOG, request, Console(as_json), perform)
