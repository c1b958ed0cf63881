"""`rid-daq payload export`: load data for a controller, read back before they are kept."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from identification.choices import LoadFormat
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import here_or_there
from rid_daq.terminal.console import Console
from rid_daq.terminal.options import DEFAULT_RUNS, AsJson, Overwrite, RunsFolder, Service


def export(
    payload: Annotated[
        Path,
        typer.Argument(
            metavar="PAYLOAD",
            help="A payload file, or a session or run that has one: folder, id, label or `latest`.",
        ),
    ],
    to: Annotated[LoadFormat, typer.Option("--to", help="Whose controller it is for.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The file to write.")
    ],
    overwrite: Overwrite = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Write a payload as a maker's controller wants it, units and frame at the top.

    The flange's frame is the robot file's tool frame. The values are those of a body that can
    exist. Nothing is written without a passed verdict; what was written is read back and compared.
    """
    from rid_daq.jobs.payload.load_data_job import PayloadExportRequest
    from rid_daq.performers.payload.export import perform

    request = PayloadExportRequest(payload, to, output, overwrite, runs)
    here_or_there(service, JobKind.PAYLOAD_EXPORT, request, Console(as_json), perform)
