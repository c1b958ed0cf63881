"""`rid-daq identify`: estimate the robot's parameters from one or more runs."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, get_args

import typer

from config.errors import ConfigError
from config.robot.robot import FrictionTerm
from identification.estimation.options import (
    BAND_HZ,
    STANDSTILL_RAD_S,
    BandHz,
    EstimationOptions,
    StandstillRadS,
)
from identification.model.options import ModelOptions
from rid_daq.jobs.identification_job import EstimationRequest, friction_terms_of
from rid_daq.jobs.identify_job import (
    MODEL,
    IdentifiedRuns,
    IdentifyRequest,
    LoadMassKg,
    LoadMassSigmaKg,
    identify_runs,
)
from rid_daq.runs.run_data import Unfinished
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.session.session import DEFAULT_RUNS, RunNames, RunsFolder
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.exit_codes import ExitCode
from rid_daq.terminal.output_file import Overwrite, refuse_output
from rid_daq.terminal.plausible_option import plausible_as


class Estimator(StrEnum):
    """How rows are weighted."""

    ML = "ml"
    LS = "ls"
    HUBER = "huber"


class Model(StrEnum):
    """What is measured of the robot."""

    INTERNAL = "internal"
    EXTERNAL = "external"
    COMBINED = "combined"


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
    friction_terms: Annotated[
        str | None,
        typer.Option(
            "--friction-terms",
            metavar="TERM,...",
            help=f"Friction of every joint: {', '.join(get_args(FrictionTerm))}.",
        ),
    ] = None,
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
            min=0.001,
            callback=plausible_as(LoadMassKg),
            help="Weighed mass of that payload [kg]: tells drive gains.",
        ),
    ] = None,
    load_mass_sigma_kg: Annotated[
        float,
        typer.Option(
            "--load-mass-sigma",
            min=1e-6,
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
    band_hz: Annotated[
        float,
        typer.Option(
            "--band", min=0.01, callback=plausible_as(BandHz), help="Highest frequency used [Hz]."
        ),
    ] = BAND_HZ,
    standstill_rad_s: Annotated[
        float,
        typer.Option(
            "--standstill",
            min=0.0,
            callback=plausible_as(StandstillRadS),
            help="Lowest speed used for friction [rad/s].",
        ),
    ] = STANDSTILL_RAD_S,
    rotors: Annotated[bool, typer.Option(help="Rotors with their coupling.")] = True,
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
    if choose and (friction_terms is not None or not friction):
        raise ConfigError("--choose chooses the friction terms: leave the other option out")
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


def perform(request: IdentifyRequest, console: Console) -> None:
    """Identify, and say what was found; exit codes as the command has them."""
    refuse_output(request.output, request.overwrite)
    identified = identify_runs(request, console)
    _print(console, identified)
    if identified.bad_joints or identified.has_mistakes:
        raise typer.Exit(ExitCode.DATA_QUALITY)


def _print(console: Console, identified: IdentifiedRuns) -> None:
    result, gains = identified.result, identified.gains
    estimate = result.estimate
    assert estimate is not None
    told = {
        "drive_gains": None
        if gains is None
        else {
            name: {"value": float(value), "std": float(sigma)}
            for name, value, sigma in zip(gains.joint_names, gains.values, gains.sigma, strict=True)
        },
        "plate": result.plate,
        "comparison": result.comparison,
    }
    console.document(
        {
            "model": str(identified.model),
            "estimate": estimate,
            **{name: part for name, part in told.items() if part is not None},
            "notes": identified.notes,
            "report": str(identified.report),
        }
    )
    if result.comparison is not None:
        result.comparison.print(console)
    estimate.print(console)
    if result.plate is not None:
        result.plate.print(console)
    if identified.plate_unused:
        console.say("The runs have a force plate's reaction too: --model combined uses it")
    for finding in estimate.findings or ():
        console.say(finding)
    for mistake in estimate.mistakes or ():
        console.verdict(False, mistake.sentence)
        console.say(f"  Change {' or '.join(mistake.change)}; read the run again.")
        for place in mistake.places or ():
            console.say(f"    {place.words}")
        if mistake.alternatives:
            as_good = "; ".join(other.words for other in mistake.alternatives)
            console.say(f"  As good an explanation: {as_good}.")
    if estimate.mistakes == ():
        console.say("No common mistake of wiring, units or files explains the data far better.")
    bad = identified.bad_joints
    console.verdict(not bad, f"Model: {identified.model}")
    console.say(f"Report: {identified.report}")
    if bad:
        console.verdict(
            False,
            f"The model does not explain the torque of {', '.join(bad)}: it is not exported without"
            " --despite-misfit. Correct the files, then identify again.",
        )
        return
    unused = ", with a run that was not used here"
    console.next_step("validate", identified.model, "RUN", then=unused)
