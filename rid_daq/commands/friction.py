"""`rid-daq friction`: friction alone, out of the runs that were made to measure it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.options import DEFAULT_RUNS, RunNames, RunsFolder, Unfinished


def friction(
    run: RunNames,
    model: Annotated[
        Path | None,
        typer.Option("--model", metavar="MODEL", help="A model file to compare with."),
    ] = None,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Measure friction alone: torque over speed, joint by joint, and the models that fit it.

    RUN is a recording of runs at constant speed, or of a path there and back in time; `rid-daq
    design --kind constant-velocity` or `--kind reversed` makes the motion. Several runs of the same
    robot are taken together.
    """
    from rid_daq.jobs.friction_job import FrictionRequest
    from rid_daq.performers.friction import perform

    request = FrictionRequest(run, runs, model, unfinished)
    here_or_there(service, JobKind.FRICTION, request, Console(as_json), perform)
