"""`rid-daq identify`: estimate the robot's parameters from one or more runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from config.errors import ConfigError
from config.ranges import least
from identification.choices import (
    BAND_HZ,
    STANDSTILL_RAD_S,
    LoadMassKg,
    LoadMassSigmaKg,
)
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import here_or_there
from rid_daq.terminal.choices import MODEL, Estimator, Model
from rid_daq.terminal.console import Console
from rid_daq.terminal.estimate_options import Band, FrictionTerms, Rotors, Standstill
from rid_daq.terminal.options import (
    DEFAULT_RUNS,
    AsJson,
    Overwrite,
    RunNames,
    RunsFolder,
    Service,
    Unfinished,
)
from rid_daq.terminal.plausible_option import plausible_as


def identify(
    run: RunNames,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="MODEL", help=f"The model file; RUN/{MODEL} if not given."
        ),
    ] = None,
    choose: Annotated[
        bool, typer.Option(help="Choose each joint's friction terms by cross-validation.")
    ] = False,
    friction_terms: FrictionTerms = None,
    estimator: Annotated[
        Estimator, typer.Option(help="Weighted by noise, not weighted, or robust.")
    ] = Estimator.ML,
    model: Annotated[
        Model, typer.Option(help="From torques, from the reaction on a force plate, or both.")
    ] = Model.INTERNAL,
    cad_prior: Annotated[
        bool, typer.Option("--cad-prior", help="Count the drawings as prior knowledge.")
    ] = False,
    loaded: Annotated[
        list[str] | None,
        typer.Option(metavar="RUN", help="A run of RUN... that carried an unknown payload."),
    ] = None,
    load_mass_kg: Annotated[
        float | None,
        typer.Option(
            "--load-mass",
            min=least(LoadMassKg),
            callback=plausible_as(LoadMassKg),
            help="Weighed mass of that payload [kg]: tells drive gains.",
        ),
    ] = None,
    load_mass_sigma_kg: Annotated[
        float,
        typer.Option(
            "--load-mass-sigma",
            min=least(LoadMassSigmaKg),
            callback=plausible_as(LoadMassSigmaKg),
            help="The scales' error (1 σ) [kg].",
        ),
    ] = 0.01,
    cross_check: Annotated[
        bool,
        typer.Option("--cross-check", help="Estimate by three other methods as well, and compare."),
    ] = False,
    diagnose: Annotated[
        bool,
        typer.Option(
            help="Look for mistakes of wiring, units and files that explain the runs far better."
        ),
    ] = True,
    band_hz: Band = BAND_HZ,
    standstill_rad_s: Standstill = STANDSTILL_RAD_S,
    rotors: Rotors = True,
    friction: Annotated[bool, typer.Option(help="Friction as the robot file names it.")] = True,
    spring: Annotated[bool, typer.Option(help="The gravity spring.")] = True,
    overwrite: Overwrite = False,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Estimate the robot's base parameters, with intervals, from one or more runs.

    Periodic runs are averaged and used on their harmonics; others are low-passed without phase
    shift and used in the time domain. The model file is complete in itself.

    Exit code 6 where the model does not explain a joint's torque, or a common mistake of wiring,
    units or files explains it far better.
    """
    from identification.estimation.options import EstimationOptions
    from identification.model.options import ModelOptions
    from rid_daq.jobs.identification_job import EstimationRequest, friction_terms_of
    from rid_daq.jobs.identify_job import IdentifyRequest
    from rid_daq.performers.identify import perform

    if choose and (friction_terms is not None or not friction):
        raise ConfigError(
            "--choose chooses the friction terms: leave the other option out",
            code="RID-OPTION-EXCLUSIVE",
        )
    request = IdentifyRequest(
        runs=runs,
        names=tuple(run),
        unfinished=unfinished,
        how=EstimationRequest(
            options=EstimationOptions(
                model=ModelOptions(
                    kind=model.value,
                    rotors=rotors,
                    friction=friction,
                    spring=spring,
                    friction_terms=friction_terms_of(friction_terms),
                    payload=bool(loaded),
                ),
                weighting=estimator.value,
                band_hz=band_hz,
                standstill_rad_s=standstill_rad_s,
            ),
            cad_prior=cad_prior,
        ),
        loaded=tuple(loaded or ()),
        load_mass_kg=None if load_mass_kg is None else (load_mass_kg, load_mass_sigma_kg),
        choose=choose,
        cross_check=cross_check,
        diagnose=diagnose,
        output=output,
        overwrite=overwrite,
    )
    here_or_there(service, JobKind.IDENTIFY, request, Console(as_json), perform)
