"""`rid-daq stream`: follow a path with the compensation computed on line."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from compensation.online.patience import BUFFER_S, CLIENT_PATIENCE_S
from config.ranges import BufferS, PatienceS, least, most
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import here_or_there
from rid_daq.terminal.console import Console
from rid_daq.terminal.estimate_options import LoopsFile, ModelFile, Temperature
from rid_daq.terminal.inapplicable_options import refuse_inapplicable
from rid_daq.terminal.options import (
    DEFAULT_RUNS,
    AsJson,
    CellName,
    Cleared,
    Pace,
    Practise,
    Realtime,
    RunsFolder,
    Seed,
    Service,
    WithoutAxisTest,
)


def stream(
    context: typer.Context,
    cell: CellName,
    model: ModelFile,
    loop: LoopsFile,
    motion: Annotated[
        Path | None,
        typer.Argument(
            metavar="[MOTION]",
            help="A motion file; points from another program if not given.",
            show_default=False,
        ),
    ] = None,
    socket: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="Where to listen for the program that sends points, in a folder of your own; a"
            " place in the runtime directory if not given.",
        ),
    ] = None,
    wait: Annotated[
        float,
        typer.Option(
            min=least(PatienceS),
            max=most(PatienceS),
            metavar="SECONDS",
            help="How long to wait for its points.",
        ),
    ] = CLIENT_PATIENCE_S,
    buffer: Annotated[
        float,
        typer.Option(
            min=least(BufferS),
            max=most(BufferS),
            metavar="SECONDS",
            help="How much of the path is taken in ahead, at least.",
        ),
    ] = BUFFER_S,
    plain: Annotated[
        bool, typer.Option("--plain", help="Without compensation: velocity feedforward alone.")
    ] = False,
    temperature: Temperature = None,
    label: Annotated[
        str | None, typer.Option(help="What to call the run; the motion file's name if not given.")
    ] = None,
    realtime: Realtime = False,
    pace: Pace = None,
    seed: Seed = 0,
    cleared: Cleared = False,
    practise: Practise = False,
    without_axis_test: WithoutAxisTest = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Follow a path more closely: the compensation is computed while the robot moves.

    The path comes from a motion file, or point by point from another program over a local socket.
    Every point is checked before it is driven. When points stop coming, or a bad one comes, the
    robot is slowed down along the points that it has until it rests (exit code 4 or 5).
    """
    from compensation.online.stream import StreamOptions
    from rid_daq.performers.compensation.stream import perform
    from rid_daq.preflight.axis_test import AxisTestRule
    from rid_daq.recording.stream_job import StreamRequest
    from rid_daq.session.cells import Simulation

    if motion is not None:
        refuse_inapplicable(context, {"wait"}, "with a motion file")
    request = StreamRequest(
        cell=cell,
        model=model,
        loop=loop,
        runs=runs,
        motion=motion,
        socket=socket,
        options=StreamOptions(compensated=not plain, buffer_s=buffer, patience_s=wait),
        temperature=temperature,
        label=label,
        simulation=Simulation(realtime=realtime, pace=pace, seed=seed),
        cleared=cleared,
        practise=practise,
        axis_test=AxisTestRule.unless(without_axis_test),
    )
    here_or_there(service, JobKind.STREAM, request, Console(as_json), perform)
