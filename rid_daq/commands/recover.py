"""`rid-daq recover`: what is readable of an unfinished, torn or damaged recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.options import DEFAULT_RUNS, RunsFolder


def recover(
    what: Annotated[
        str,
        typer.Argument(
            metavar="FILE|RUN", help="A recording (.mcap), or a run folder, its id or label."
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="PATH",
            help="Of a file: the file to write; of a run: the folder for the new run folder."
            " Beside the old one if not given.",
        ),
    ] = None,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Write what is readable of a damaged recording as a new one; the old one is never changed.

    Only blocks whose checksums are right are taken, so no number in the new recording is wrong, and
    every row known to be lost is told. A run becomes a new run folder that all commands read. The
    exit code is 0 where no row is known to be lost, 1 where some are, 7 where nothing is readable.
    """
    from rid_daq.performers.recover import RecoverRequest, perform

    request = RecoverRequest(what, runs, output)
    here_or_there(service, JobKind.RECOVER, request, Console(as_json), perform)
