"""`rid-daq payload certificate`: a payload's certificate as PDF."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import here_or_there
from rid_daq.terminal.choices import CERTIFICATE
from rid_daq.terminal.console import Console
from rid_daq.terminal.options import DEFAULT_RUNS, AsJson, Overwrite, RunsFolder, Service


def certificate(
    session: Annotated[
        str,
        typer.Argument(
            metavar="SESSION",
            help="A payload session, or a run with a payload of `payload identify`.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help=f"The PDF; {CERTIFICATE} in the session if not."
        ),
    ] = None,
    by: Annotated[
        str | None, typer.Option("--by", metavar="NAME", help="Who answers for it.")
    ] = None,
    overwrite: Overwrite = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Write a payload's certificate: values with intervals, verdict with limits, origin, SHA-256.

    Every file that it lists is compared with its SHA-256 first. A failed verdict is certified as
    failed; a session that is not finished is refused. The same session gives the same bytes.
    """
    from rid_daq.performers.payload.certificate import perform
    from rid_daq.recording.certificate_job import PayloadCertificateRequest

    request = PayloadCertificateRequest(session, runs, output, by, overwrite)
    here_or_there(service, JobKind.PAYLOAD_CERTIFICATE, request, Console(as_json), perform)
