"""`rid-daq payload read-back`: what a controller holds, against what was measured."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from identification.payload.body import REPORTED, REPORTED_UNITS
from identification.payload.controllers.formats import LoadFormat
from rid_daq.jobs.payload.load_data_job import ReadBackRequest, read_back_payload
from rid_daq.report.formats import number
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.exit_codes import ExitCode


def read_back(
    payload: Annotated[
        Path, typer.Argument(metavar="PAYLOAD", help="A payload file of `payload identify`.")
    ],
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Load data, as exported or saved from the robot.")
    ],
    form: Annotated[LoadFormat, typer.Option("--from", help="Whose controller it comes from.")],
    tolerance_percent: Annotated[
        float,
        typer.Option(
            "--tolerance", min=0.0, help="Largest difference [%]: controllers round what they hold."
        ),
    ] = 0.1,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Parse load data and compare them with a payload; exit code 1 where they differ.

    Compared are the mass, the centre of gravity (as a share of its distance from the flange) and
    the inertia (as a share of its largest moment).
    """
    request = ReadBackRequest(payload, form, file, tolerance_percent=tolerance_percent)
    here_or_there(service, JobKind.PAYLOAD_READ_BACK, request, Console(as_json), perform)


def perform(request: ReadBackRequest, console: Console) -> None:
    """Compare, and say the verdict; exit codes as the command has them."""
    found = read_back_payload(request)
    measured, read, verdict = found.measured.reported, found.found.reported, found.verdict
    console.document(
        {
            "file": request.source,
            "format": request.form.value,
            "verdict": verdict,
            "read": dict(zip(REPORTED, read.tolist(), strict=True)),
        }
    )
    console.table(
        ("parameter", "measured", "read", "unit"),
        [
            (name, number(float(wanted), 6), number(float(held), 6), unit)
            for name, unit, wanted, held in zip(
                REPORTED, REPORTED_UNITS, measured, read, strict=True
            )
        ],
    )
    console.verdict(verdict.passed, verdict.headline)
    if not verdict.passed:
        raise typer.Exit(ExitCode.VERDICT_FAILED)
