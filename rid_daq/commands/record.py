"""`rid-daq record`: run a motion on a cell and record it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import here_or_there
from rid_daq.terminal.console import Console
from rid_daq.terminal.options import (
    DEFAULT_LISTEN,
    DEFAULT_RUNS,
    AsJson,
    CellName,
    Certificate,
    Cleared,
    Listen,
    Live,
    Pace,
    Practise,
    Realtime,
    RunsFolder,
    Seed,
    Service,
    Token,
    WithoutAxisTest,
)


def record(
    cell: CellName,
    motion: Annotated[Path, typer.Argument(metavar="MOTION", help="A motion file.")],
    until: Annotated[
        list[str] | None,
        typer.Option(
            metavar="GOAL",
            help="End early once a standard deviation is reached, as sx3<0.01kgm, fv_axis1<5% or"
            " torque<1.5Nm; repeat for more.",
        ),
    ] = None,
    feedforward: Annotated[
        Path | None,
        typer.Option(
            metavar="FEEDFORWARD", help="Pre-compensation of this motion, by `compensate`."
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            metavar="MODEL",
            help="A model by `identify`: a motion that takes more torque than a joint has by it is"
            " refused.",
        ),
    ] = None,
    label: Annotated[
        str | None, typer.Option(help="What to call the run; the motion file's name if not given.")
    ] = None,
    realtime: Realtime = False,
    pace: Pace = None,
    seed: Seed = 0,
    payload: Annotated[
        str | None,
        typer.Option(help="What a simulated robot carries, by its name in the plant file."),
    ] = None,
    faults: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A fault script: what goes wrong in a simulated cell."),
    ] = None,
    rehearse: Annotated[
        bool,
        typer.Option(
            "--rehearse",
            help="Drive it once at a quarter of its speed first, into a run of its own.",
        ),
    ] = False,
    frames: Annotated[
        bool,
        typer.Option(
            "--frames",
            help="Every frame on the bus goes into frames.blf of the run, for bus analysers.",
        ),
    ] = False,
    cleared: Cleared = False,
    practise: Practise = False,
    without_axis_test: WithoutAxisTest = False,
    live: Live = False,
    listen: Listen = DEFAULT_LISTEN,
    token: Token = None,
    certificate: Certificate = None,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Run a motion on a cell and record it into a new run folder.

    The motion is checked against every limit before anything moves (exit code 3). Ctrl-C stops the
    robot (a quick stop, then power off) and keeps what was recorded. It is not an emergency stop.
    Where a goal of --until is not reached by the last period, the exit code is 1. Where more than
    2 % of a drive's answers were lost, or more than 5 periods are bad, it is 6.
    """
    from rid_daq.live.live_page import LiveOptions
    from rid_daq.performers.record import perform
    from rid_daq.preflight.axis_test import AxisTestRule
    from rid_daq.recording.record_job import RecordRequest
    from rid_daq.session.cells import Simulation

    request = RecordRequest(
        cell=cell,
        motion=motion,
        runs=runs,
        until=until or (),
        feedforward=feedforward,
        model=model,
        faults=faults,
        label=label,
        simulation=Simulation(realtime=realtime, pace=pace, seed=seed, payload=payload),
        rehearse=rehearse,
        frames=frames,
        cleared=cleared,
        practise=practise,
        axis_test=AxisTestRule.unless(without_axis_test),
        live=LiveOptions(live, listen, token, certificate),
    )
    here_or_there(service, JobKind.RECORD, request, Console(as_json), perform)
