"""`rid-daq identify`: estimate the robot's parameters from one or more runs."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, cast, get_args

import numpy as np
import typer

from acquisition.runs.catalogue import find_run, find_runs
from config.errors import ConfigError, EstimationError
from config.robot.robot import FrictionTerm
from identification.accuracy.identifiability import weak_parameters
from identification.calibration.base_reaction import weight_words
from identification.consistency.closest_robot import consistent
from identification.cross_checks.agreement import CrossCheck, Method
from identification.estimation.estimate import Estimate
from identification.estimation.file import write_estimate
from identification.estimation.options import BAND_HZ, STANDSTILL_RAD_S, EstimationOptions
from identification.model.options import ModelOptions
from identification.validation.friction_drift import friction_drift
from identification.validation.friction_selection import FRICTION_CANDIDATES, Comparison
from identification.validation.period_comparison import compare_period
from rid_daq.jobs.identification_job import (
    EstimationRequest,
    check_otherwise,
    compare_friction,
    estimate_runs,
    gains_of_drives,
)
from rid_daq.report.result_file import write_result
from rid_daq.report.sections.average import AverageSection
from rid_daq.report.sections.comparison import ComparisonSection
from rid_daq.report.sections.curves import CurvesSection
from rid_daq.report.sections.estimate import EstimateSection
from rid_daq.report.sections.plate import PlateSection
from rid_daq.runs.run_data import RunData, Unfinished, note_output, result_of, tell_lacks
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.output_file import Overwrite, refuse_output

MODEL = "model.json"


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
    run: Annotated[
        list[str],
        typer.Argument(metavar="RUN...", help="Run folders, ids or labels, or `latest`."),
    ],
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
            "--load-mass", min=0.001, help="Weighed mass of that payload [kg]: tells drive gains."
        ),
    ] = None,
    load_mass_sigma_kg: Annotated[
        float, typer.Option("--load-mass-sigma", min=1e-6, help="The scales' error (1 σ) [kg].")
    ] = 0.01,
    cross_check: Annotated[
        bool,
        typer.Option("--cross-check", help="Estimate by three other methods as well, and compare."),
    ] = False,
    band_hz: Annotated[
        float, typer.Option("--band", min=0.01, help="Highest frequency used [Hz].")
    ] = BAND_HZ,
    standstill_rad_s: Annotated[
        float, typer.Option("--standstill", min=0.0, help="Lowest speed used for friction [rad/s].")
    ] = STANDSTILL_RAD_S,
    rotors: Annotated[bool, typer.Option(help="Rotors with their coupling.")] = True,
    friction: Annotated[bool, typer.Option(help="Friction as the robot file names it.")] = True,
    spring: Annotated[bool, typer.Option(help="The gravity spring.")] = True,
    overwrite: Overwrite = False,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Estimate the robot's base parameters, with intervals, from one or more runs.

    Periodic runs are averaged and used on their harmonics; others are low-passed without phase
    shift and used in the time domain. The model file is complete in itself.
    """
    console = Console(as_json)
    refuse_output(output, overwrite)
    data = [RunData.load(folder, unfinished=unfinished) for folder in find_runs(runs, run)]
    notes = tell_lacks(console, data)
    how = EstimationRequest(
        options=EstimationOptions(
            model=ModelOptions(
                kind=model.value,
                rotors=rotors,
                friction=friction,
                spring=spring,
                friction_terms=_terms(friction_terms),
                payload=bool(loaded),
            ),
            weighting=estimator.value,
            band_hz=band_hz,
            standstill_rad_s=standstill_rad_s,
        ),
        cad_prior=cad_prior,
        loaded=_loaded(runs, data, loaded or []),
    )
    if load_mass_kg is not None and not how.loaded:
        raise ConfigError(
            "--load-mass is the mass of the payload: name the runs with it (--loaded)"
        )
    comparison = None
    if choose:
        if friction_terms is not None or not friction:
            raise ConfigError("--choose chooses the friction terms: leave the other option out")
        comparison = _compare(console, data, how)
    robot = None if comparison is None else comparison.robot(data[0].robot)
    identified = estimate_runs(data, how, robot=robot)
    estimate = identified.estimate
    gains = None
    if load_mass_kg is not None:
        gains = gains_of_drives(estimate, data, how, load_mass_kg, load_mass_sigma_kg)
    weight = weight_words(estimate)
    plate = None
    if estimate.plate is not None:
        plate = PlateSection.of(
            estimate.plate, weight, identified.improvement, identified.consistency
        )
    first = data[0]
    output = output or first.folder.file(MODEL)
    write_estimate(output, estimate)
    note_output(first.folder, output)
    weak = [each for each in weak_parameters(estimate) if each.expression not in weight]
    findings = [each.sentence for each in weak]
    for item in data:
        drifts = (drift for drift in friction_drift(item.recording) if drift.significant)
        findings += [f"Run {item.folder.run_id}: {drift.sentence}." for drift in drifts]
    findings.append(_existence(estimate))
    if gains is not None:
        findings += [f"{sentence}." for sentence in gains.sentences()]
    if cross_check:
        findings += _cross_check(console, estimate, data, how)
    section = EstimateSection.of(estimate, findings=findings)
    document: dict[str, object] = {"model": str(output), "estimate": section}
    if gains is not None:
        document["drive_gains"] = {
            name: {"value": float(value), "std": float(sigma)}
            for name, value, sigma in zip(gains.joint_names, gains.values, gains.sigma, strict=True)
        }
    compared = None if comparison is None else ComparisonSection.of(comparison)
    parts = {"plate": plate, "comparison": compared}
    document |= {name: part for name, part in parts.items() if part is not None}
    result = result_of(first, notes).updated(estimate=section, **parts)
    if first.is_periodic:
        average = identified.averages[0]
        period = compare_period(estimate, average)
        result = result.updated(
            average=AverageSection.of(average, first.robot),
            curves=CurvesSection.of_period(estimate, period, average.periods_kept),
        )
    path = write_result(first.folder, result)
    console.document({**document, "notes": notes, "report": str(path)})
    if compared is not None:
        compared.print(console)
    section.print(console)
    if plate is not None:
        plate.print(console)
    elif all(item.recording.reaction is not None for item in data) and first.is_periodic:
        console.say("The runs have a force plate's reaction too: --model combined uses it")
    for finding in findings:
        console.say(finding)
    console.verdict(True, f"Model: {output}")
    console.say(f"Report: {path}")
    console.next_step("validate", output, "RUN", then=", with a run that was not used here")


def _existence(estimate: Estimate) -> str:
    """Say whether a robot with such parameters can exist."""
    try:
        robot = consistent(estimate)
    except EstimationError as error:
        return f"Whether a robot with such parameters can exist is not known: {error}."
    if robot.can_exist:
        return (
            "A robot with such parameters can exist (positive masses, inertias and friction;"
            f" p = {robot.p_value:.2g}): `rid-daq export` writes it."
        )
    worst = int(np.argmax(np.abs(robot.moved_sigmas)))
    return (
        f"No robot can have these parameters (p = {robot.p_value:.2g}): the closest one differs"
        f" most in {estimate.base.expressions[worst]}, by {abs(robot.moved_sigmas[worst]):.1f} σ. A"
        " term is missing in the model, or a sign, ratio or torque constant in the robot file is"
        " wrong."
    )


def _cross_check(
    console: Console, estimate: Estimate, data: list[RunData], how: EstimationRequest
) -> list[str]:
    checks: list[CrossCheck] = []
    with console.progress("Cross-checking", float(len(Method)), "methods") as shown:
        shown.update(0.0, f"next: {next(iter(Method))}")
        for number, check in enumerate(check_otherwise(estimate, data, how), 1):
            checks.append(check)
            shown.update(float(number), check.sentence)
    return [f"{check.sentence}." for check in checks]


def _terms(text: str | None) -> tuple[FrictionTerm, ...] | None:
    if text is None:
        return None
    terms = tuple(term.strip() for term in text.split(",") if term.strip())
    if not terms:
        raise ConfigError("--friction-terms names none; --no-friction leaves friction out")
    known = get_args(FrictionTerm)
    strangers = [term for term in terms if term not in known]
    if strangers or len(set(terms)) != len(terms):
        raise ConfigError(
            f"--friction-terms {text}: {', '.join(strangers) or 'a term stands twice'}; the terms"
            f" are {', '.join(known)}"
        )
    return cast(tuple[FrictionTerm, ...], terms)


def _loaded(runs: Path, data: list[RunData], names: list[str]) -> tuple[str, ...]:
    """Return the ids of the runs that carried the payload, which must be among those used."""
    ids = tuple(find_run(runs, name).run_id for name in names)
    used = {item.folder.run_id for item in data}
    for name, run_id in zip(names, ids, strict=True):
        if run_id not in used:
            raise ConfigError(f"--loaded {name}: is not among the runs to identify; name it there")
    if ids and used <= set(ids):
        raise ConfigError(
            "every run carried the payload, so that it cannot be told from the last link: add a run"
            " without it"
        )
    return ids


def _compare(console: Console, data: list[RunData], how: EstimationRequest) -> Comparison:
    total = float(len(FRICTION_CANDIDATES) + 1)
    with console.progress("Comparing models", total, "models") as shown:
        return compare_friction(
            data, how, lambda done, _, terms: shown.update(float(done), f"next: {terms}")
        )
