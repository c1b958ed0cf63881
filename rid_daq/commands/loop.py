"""`rid-daq loop`: the drives' velocity loops, out of a multisine run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.options import DEFAULT_RUNS, Overwrite, RunsFolder, Unfinished


def loop(
    run: Annotated[
        str, typer.Argument(metavar="RUN", help="A multisine run: folder, id, label or `latest`.")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="LOOPS",
            help="The file of loops; RUN/loops.json if not given.",
        ),
    ] = None,
    overwrite: Overwrite = False,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Measure how the drives' velocity loops answer, and fit gain and integral time.

    The run is of a motion by `rid-daq design --kind multisine`. Intervals are two standard
    deviations, from what differs between periods and between realisations. The margins are those
    of current, velocity and position loop together; the run's report draws everything.
    """
    from rid_daq.jobs.loop_job import LoopRequest
    from rid_daq.performers.compensation.loop import perform

    request = LoopRequest(run, runs, output, overwrite, unfinished)
    here_or_there(service, JobKind.LOOP, request, Console(as_json), perform)
