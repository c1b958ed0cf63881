"""`rid-daq validate`: predict another run's torques and judge the error."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from config.ranges import least
from identification.choices import STANDSTILL_RAD_S, BandHz, StandstillRadS
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import here_or_there
from rid_daq.terminal.console import Console
from rid_daq.terminal.estimate_options import BaseMass
from rid_daq.terminal.inapplicable_options import refuse_inapplicable
from rid_daq.terminal.options import DEFAULT_RUNS, AsJson, RunsFolder, Service, Unfinished
from rid_daq.terminal.plausible_option import plausible_as


def validate(
    context: typer.Context,
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="A model file of `identify`.")],
    run: Annotated[
        str,
        typer.Argument(
            metavar="RUN",
            help="A run that the model was not identified from; with --base-limits also a motion"
            " file, whose reaction is predicted.",
        ),
    ],
    limits: Annotated[
        str | None,
        typer.Option(
            metavar="PERCENT,...",
            help="Largest relative error, one number or one an axis; the cell file's if not given.",
        ),
    ] = None,
    band_hz: Annotated[
        float | None,
        typer.Option(
            "--band",
            min=least(BandHz),
            callback=plausible_as(BandHz),
            help="Highest frequency that is compared [Hz] (default: the model's own band).",
        ),
    ] = None,
    standstill_rad_s: Annotated[
        float,
        typer.Option(
            "--standstill",
            min=least(StandstillRadS),
            callback=plausible_as(StandstillRadS),
            help="Lowest speed that counts [rad/s].",
        ),
    ] = STANDSTILL_RAD_S,
    base: Annotated[
        bool,
        typer.Option("--base-limits", help="Judge the reaction on the base by the cell's limits."),
    ] = False,
    mass_kg: BaseMass = None,
    cell: Annotated[
        str | None,
        typer.Option(metavar="CELL", help="Of a motion file: the cell, for its limits and cycle."),
    ] = None,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Predict a run's torques with a model and judge the error, axis by axis.

    Exit code 1 where an axis, or the reaction on the base, exceeds its limit; 6 where the run
    allows no verdict: the model was identified from it, or it moves for less than 5 s.
    """
    from rid_daq.jobs.validate_job import ValidateRequest
    from rid_daq.performers.validate import perform

    request = ValidateRequest(
        model=model,
        run=run,
        runs=runs,
        limits=limits,
        band_hz=band_hz,
        standstill_rad_s=standstill_rad_s,
        base=base,
        mass_kg=mass_kg,
        cell=cell,
        unfinished=unfinished,
    )
    if request.is_motion_file:
        of_runs = {"limits", "band_hz", "standstill_rad_s", "unfinished"}
        refuse_inapplicable(context, of_runs, "with a motion file")
    else:
        refuse_inapplicable(context, {"cell"}, "with a run, which has its own")
        if not base:
            refuse_inapplicable(context, {"mass_kg"}, "without --base-limits")
    here_or_there(service, JobKind.VALIDATE, request, Console(as_json), perform)
