"""`rid-daq payload read-back`: what a controller holds, against what was measured."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from config.ranges import TolerancePercent, least, most
from identification.choices import LoadFormat
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import here_or_there
from rid_daq.terminal.console import Console
from rid_daq.terminal.options import DEFAULT_RUNS, AsJson, RunsFolder, Service


def read_back(
    payload: Annotated[
        Path,
        typer.Argument(
            metavar="PAYLOAD",
            help="A payload file, or a session or run that has one: folder, id, label or `latest`.",
        ),
    ],
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Load data, as exported or saved from the robot.")
    ],
    form: Annotated[LoadFormat, typer.Option("--from", help="Whose controller it comes from.")],
    tolerance_percent: Annotated[
        float,
        typer.Option(
            "--tolerance",
            min=least(TolerancePercent),
            max=most(TolerancePercent),
            help="Largest difference [%]: controllers round what they hold.",
        ),
    ] = 0.1,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Parse load data and compare them with a payload; exit code 1 where they differ.

    Compared are the mass, the centre of gravity (as a share of its distance from the flange) and
    the inertia (as a share of its largest moment).
    """
    from rid_daq.jobs.payload.load_data_job import ReadBackRequest
    from rid_daq.performers.payload.read_back import perform

    request = ReadBackRequest(payload, form, file, tolerance_percent=tolerance_percent, runs=runs)
    here_or_there(service, JobKind.PAYLOAD_READ_BACK, request, Console(as_json), perform)
