"""`rid-daq validate`: predict another run's torques and judge the error."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from acquisition.runs.catalogue import find_run
from config.arrays import FloatArray
from config.cell.cell import CellConfig
from config.cell.plate import PlateLimits
from config.errors import ConfigError, DataQualityError
from config.load import load_bundled_or_path
from identification.calibration.base_reaction import base_load
from identification.estimation.estimate import Estimate
from identification.estimation.file import read_estimate
from identification.estimation.options import BAND_HZ, STANDSTILL_RAD_S
from identification.validation.base_wrench_validation import validate_base_wrench
from identification.validation.diagnosis import diagnose
from identification.validation.torque_prediction import validate as compare
from rid_daq.jobs.motion_load import is_motion_file, limits_of, motion_load
from rid_daq.report.formats import number
from rid_daq.report.result_file import write_result
from rid_daq.report.sections.base_load import BaseLoadSection
from rid_daq.report.sections.curves import CurvesSection, TorqueCurves
from rid_daq.report.sections.estimate import EstimateSection
from rid_daq.report.sections.reaction import ReactionSection
from rid_daq.report.sections.validation import ValidationSection
from rid_daq.report.sections.verdict import Check, Verdict
from rid_daq.runs.run_data import RunData, Unfinished, report_lacks, result_of
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.exit_codes import ExitCode
from rid_daq.terminal.inapplicable_options import refuse_inapplicable


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
        float, typer.Option("--band", min=0.01, help="Signals are compared up to here [Hz].")
    ] = BAND_HZ,
    standstill_rad_s: Annotated[
        float, typer.Option("--standstill", min=0.0, help="Lowest speed that counts [rad/s].")
    ] = STANDSTILL_RAD_S,
    base: Annotated[
        bool,
        typer.Option("--base-limits", help="Judge the reaction on the base by the cell's limits."),
    ] = False,
    mass_kg: Annotated[
        float | None,
        typer.Option("--mass", min=0.0, help="Mass of all that the base carries [kg]."),
    ] = None,
    cell: Annotated[
        str | None,
        typer.Option(metavar="CELL", help="Of a motion file: the cell, for its limits and cycle."),
    ] = None,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Predict a run's torques with a model and judge the error, axis by axis.

    Exit code 1 where an axis, or the reaction on the base, exceeds its limit.
    """
    console = Console(as_json)
    if is_motion_file(run):
        of_runs = {"limits", "band_hz", "standstill_rad_s", "unfinished"}
        refuse_inapplicable(context, of_runs, "with a motion file")
        _predict(console, read_estimate(model), Path(run), base, cell, mass_kg)
        return
    refuse_inapplicable(context, {"cell"}, "with a run, which has its own")
    if not base:
        refuse_inapplicable(context, {"mass_kg"}, "without --base-limits")
    estimate = read_estimate(model)
    if estimate.options.kind == "external":
        refuse_inapplicable(context, {"limits"}, "with an external model, which knows no friction")
    data = RunData.load(find_run(runs, run), unfinished=unfinished)
    notes = report_lacks(console, [data])
    validation = compare(
        estimate,
        data.recording,
        cutoff_hz=band_hz,
        standstill_rad_s=standstill_rad_s,
        limits_percent=None if estimate.options.kind == "external" else _limits(limits, data),
        noise_nm=_noise(data),
    )
    result = result_of(data, notes)
    same = data.folder.run_id in estimate.run_ids
    sentence = f"Run {data.folder.manifest().label!r} predicted by {model.name}."
    if estimate.options.kind == "external":
        sentence += " The external model knows no friction: torques are not judged."
    if same:
        sentence += " The model was identified from this very run: this is no validation."
    section = ValidationSection.of(
        validation,
        data.robot,
        sentence,
        diagnosis=[found.sentence for found in diagnose(estimate, validation)],
    )
    reaction = load = None
    if data.recording.reaction is not None and estimate.options.kind != "internal":
        try:
            compared = validate_base_wrench(estimate, data.recording, cutoff_hz=band_hz)
            reaction = ReactionSection.of(compared)
        except DataQualityError as error:
            console.say(f"The reaction on the base is not compared: {error}")
    if base:
        motion = (validation.position, validation.velocity, validation.acceleration)
        limits_of_base = _base_limits(data)
        load = BaseLoadSection.of(
            base_load(estimate, validation.time_s, *motion, limits_of_base, mass_kg=mass_kg)
        )
    judged = _verdict(section, estimate, load)
    curves = (result.curves or CurvesSection()).model_copy(
        update={"torque": TorqueCurves.of(validation, data.robot)}
    )
    result = result.updated(
        title=f"Validation of {estimate.robot.name}",
        validation=section,
        estimate=EstimateSection.of(estimate),
        curves=curves,
        reaction=reaction,
        base_load=load,
        verdict=judged,
    )
    path = write_result(data.folder, result)
    plate = {"reaction": reaction, "base_load": load}
    console.document(
        {
            "validation": section,
            **{name: part for name, part in plate.items() if part is not None},
            "verdict": judged,
            "notes": notes,
            "report": str(path),
        }
    )
    section.print(console)
    for part in (reaction, load):
        if part is not None:
            part.print(console)
            console.say(part.sentence)
    console.verdict(judged.passed, judged.headline)
    console.say(f"Report: {path}")
    if judged.passed is False:
        raise typer.Exit(ExitCode.VERDICT_FAILED)


def _predict(
    console: Console,
    estimate: Estimate,
    motion: Path,
    base: bool,
    cell: str | None,
    mass_kg: float | None,
) -> None:
    """Predict the reaction of a motion that nobody has run, and judge it."""
    if not base:
        raise ConfigError(
            f"{motion}: is a motion file: without a run only the reaction on the base can be judged"
            " (--base-limits); record it to judge torques"
        )
    load = motion_load(estimate, motion, cell, mass_kg)
    more = " That is the motion as commanded: overshoot of the drives comes on top."
    section = BaseLoadSection.of(load, more)
    failed = [line.text.rsplit(" ", 1)[-1] for line in section.checks if not line.passed]
    judged = Verdict.of(
        section.checks,
        f"Failed: {', '.join(failed)} beyond the limit"
        if failed
        else f"Passed: {motion.name} keeps the limits of the base",
        section.sentence,
    )
    console.document({"base_load": section, "verdict": judged})
    section.print(console)
    console.say(section.sentence)
    console.verdict(judged.passed, judged.headline)
    if failed:
        raise typer.Exit(ExitCode.VERDICT_FAILED)


def _noise(data: RunData) -> FloatArray | None:
    """Return the noise of one torque sample as periods show it; None where there are none."""
    if not data.is_periodic:
        return None
    try:
        return np.asarray(np.sqrt(data.average.torque_variance))
    except DataQualityError:
        return None


def _limits(text: str | None, data: RunData) -> tuple[float, ...] | None:
    """Return the limit of every axis: those given, or the cell file's."""
    count = len(data.robot.joints)
    if text is not None:
        try:
            values = tuple(float(word) for word in text.split(","))
        except ValueError:
            values = ()
        if len(values) not in (1, count) or not all(0.0 < value < 1e6 for value in values):
            raise ConfigError(
                f"--limits {text}: give one percentage, or {count} separated by commas, such as"
                f" {','.join(['10'] * count)}"
            )
        return values * (count if len(values) == 1 else 1)
    cell = _cell(data)
    return None if cell is None else cell.validation_limits_percent


def _cell(data: RunData) -> CellConfig | None:
    """Return the cell of a run, where it was recorded on one."""
    path = data.folder.file("cell.yaml")
    return load_bundled_or_path(str(path), "cells", CellConfig) if path.exists() else None


def _base_limits(data: RunData) -> PlateLimits:
    """Return what the run's cell file says that the floor may see."""
    cell = _cell(data)
    return limits_of(cell, "the run's cell file")


def _verdict(
    section: ValidationSection, estimate: Estimate, load: BaseLoadSection | None
) -> Verdict:
    checks = [
        Check.of(
            f"relative torque error, {axis.joint}",
            axis.relative_error_percent,
            "≤",
            axis.limit_percent,
            "%",
        )
        for axis in section.axes
        if axis.limit_percent is not None and axis.relative_error_percent is not None
    ]
    checks += [] if load is None else load.checks
    errors = ", ".join(f"{number(axis.relative_error_percent, 3)}" for axis in section.axes)
    sentence = f"Relative torque error, axis by axis: {errors} %."
    if not checks:
        return Verdict.of([], "Torques predicted; no limits were given", sentence)
    failed = [line.text.rsplit(" ", 1)[-1] for line in checks if not line.passed]
    headline = (
        f"Failed: {', '.join(failed)} beyond the limit"
        if failed
        else f"Passed: the model of {estimate.robot.name} predicts this run"
    )
    return Verdict.of(checks, headline, sentence)
