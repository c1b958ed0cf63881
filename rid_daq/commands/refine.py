"""`rid-daq refine`: the next feedforward, from what the robot missed with this one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.estimate_options import LoopsFile, ModelFile, Temperature
from rid_daq.terminal.options import DEFAULT_RUNS, Overwrite, RunNames, RunsFolder, Unfinished


def refine(
    run: RunNames,
    model: ModelFile,
    loop: LoopsFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FEEDFORWARD", help="The file to write.")
    ],
    temperature: Temperature = None,
    overwrite: Overwrite = False,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Correct a feedforward by what the robot missed with it.

    One run of a periodic motion, or two and more of another one, all with the same feedforward.
    Record the motion with the file that this writes, and refine again. Once the remaining error is
    noise, or has stopped shrinking, it says so and the file is the one that the run had. An error
    that grows is refused.
    """
    from rid_daq.jobs.feedforward_job import RefineRequest
    from rid_daq.performers.compensation.refine import perform

    request = RefineRequest(run, model, loop, output, runs, temperature, overwrite, unfinished)
    here_or_there(service, JobKind.REFINE, request, Console(as_json), perform)
