"""`rid-daq loop`: the drives' velocity loops, out of a multisine run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rid_daq.jobs.loop_job import LoopRequest, measure_velocity_loops
from rid_daq.runs.run_data import Unfinished
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.exit_codes import ExitCode
from rid_daq.terminal.output_file import Overwrite


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
    request = LoopRequest(run, runs, output, overwrite, unfinished)
    here_or_there(service, JobKind.LOOP, request, Console(as_json), perform)


def perform(request: LoopRequest, console: Console) -> None:
    """Measure the loops, and say what they are; exit codes as the command has them."""
    found = measure_velocity_loops(request)
    for note in found.notes:
        console.say(f"note: {note}")
    told = {"run": found.run_id, "loops": str(found.output), "report": str(found.report)}
    console.document({**told, **found.section.model_dump(mode="json"), "notes": found.notes})
    found.section.print(console)
    console.say(f"Report: {found.report}")
    console.say(f"Loops: {found.output}")
    if found.section.bad_joints:
        raise typer.Exit(ExitCode.DATA_QUALITY)
    console.say(
        f"Next: rid-daq compensate CELL MOTION --model MODEL --loop {found.output} -o FEEDFORWARD"
    )
