"""`rid-daq compare`: two estimates, or the runs behind them, side by side."""

from __future__ import annotations

from typing import Annotated

import typer

from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.options import DEFAULT_RUNS, RunsFolder, Unfinished


def compare(
    first: Annotated[
        str, typer.Argument(metavar="RUN|MODEL", help="A run that was identified, or a model file.")
    ],
    second: Annotated[str, typer.Argument(metavar="RUN|MODEL", help="The other one.")],
    on: Annotated[
        str | None,
        typer.Option(
            metavar="RUN",
            help="Predict this run's torques with both; if not given, the runs named.",
        ),
    ] = None,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Compare two estimates of one robot: parameters with intervals, and predicted torques.

    Differences are told in standard deviations. Exit code 1 where one is larger than noise
    explains: the robot, its load or its surroundings have changed, or a model lacks something.
    """
    from rid_daq.jobs.compare_job import CompareRequest
    from rid_daq.performers.compare import perform

    request = CompareRequest(first, second, runs, on, unfinished)
    here_or_there(service, JobKind.COMPARE, request, Console(as_json), perform)
