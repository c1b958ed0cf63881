"""`rid-daq export`: an identified model, or a run's recording, for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import here_or_there
from rid_daq.terminal.choices import Format
from rid_daq.terminal.console import Console
from rid_daq.terminal.inapplicable_options import refuse_inapplicable
from rid_daq.terminal.options import (
    DEFAULT_RUNS,
    AsJson,
    Overwrite,
    RunsFolder,
    Service,
    Unfinished,
)


def export(
    context: typer.Context,
    what: Annotated[
        str,
        typer.Argument(
            metavar="MODEL|RUN", help="A model file of identify; or a run folder, its id or label."
        ),
    ],
    to: Annotated[
        Format,
        typer.Option(
            "--to",
            help="Of a model: urdf, sdf, pinocchio: a robot description with inertias; c, python: a"
            " function for inverse dynamics; csv, json: a table of the parameters. Of a run: csv,"
            " parquet, mat, mdf4: everything recorded, a column a quantity and joint.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The file to write.")
    ],
    as_identified: Annotated[
        bool,
        typer.Option(
            "--as-identified",
            help="Functions and tables with the identified parameters alone, not those of a robot"
            " that can exist: the same torques as the model file, but a mass matrix that need not"
            " be positive.",
        ),
    ] = False,
    despite_misfit: Annotated[
        bool,
        typer.Option(
            "--despite-misfit",
            help="Write a model although the data speak against it, as the nearest robot that can"
            " exist; the file says so.",
        ),
    ] = False,
    overwrite: Overwrite = False,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Write an identified model, or a run's recording, for other programs.

    Of a model the parameters are those that real bodies can have and that are closest to the
    identified ones; where no such robot explains the data, nothing is written. What a format cannot
    say stands at its top. Tables hold both, with the identified parameters' intervals. Of a run
    every row is written as it was recorded.
    """
    from rid_daq.jobs.export_job import ExportRequest
    from rid_daq.performers.export import perform

    request = ExportRequest(
        what, to, output, runs, as_identified, despite_misfit, unfinished, overwrite
    )
    # A service's files are not seen from here.
    is_model = request.is_model if service is None else what.endswith(".json")
    if is_model:
        refuse_inapplicable(context, {"unfinished"}, "with a model file")
        if as_identified:
            refuse_inapplicable(context, {"despite_misfit"}, "with --as-identified")
    else:
        refuse_inapplicable(context, {"as_identified", "despite_misfit"}, "with a recording")
    here_or_there(service, JobKind.EXPORT, request, Console(as_json), perform)
