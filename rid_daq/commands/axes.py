"""`rid-daq axes`: the axis test, before the first motion of a cell."""

from __future__ import annotations

from typing import Annotated

import typer

from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import here_or_there
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


def axes(
    cell: CellName,
    joint: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Test this joint alone; repeat for more."),
    ] = None,
    unattended: Annotated[
        bool,
        typer.Option(
            "--unattended",
            help="A simulated cell is its own person: no key is held, its true axes answer.",
        ),
    ] = False,
    realtime: Realtime = False,
    seed: Seed = 0,
    cleared: Cleared = False,
    practise: Practise = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Test direction, encoder and gear of every axis before the first motion.

    One axis at a time moves by 2 degrees (5 mm) at 2 % of its speed while SPACE is held, and stops
    when it is let go. You say which way it moved and about how far; its drive says what it counted.
    What does not fit is named, with the line of the file to change (exit code 1). Axes that pass
    are signed beside the cell file; on a real cell every other motion wants that, until the cell
    or the robot file changes.
    """
    from rid_daq.commissioning.axis_test_job import AxisTestRequest
    from rid_daq.performers.axes import perform
    from rid_daq.session.cells import Simulation

    request = AxisTestRequest(
        cell=cell,
        runs=runs,
        joints=joint or (),
        unattended=unattended,
        simulation=Simulation(realtime=realtime, seed=seed),
        cleared=cleared,
        practise=practise,
    )
    here_or_there(service, JobKind.AXES, request, Console(as_json), perform)
