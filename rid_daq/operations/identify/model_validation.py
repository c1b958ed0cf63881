"""`validate_run`, `predict_motion`: torques of a run and base reactions, predicted and judged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.runs.catalogue import find_run
from config.arrays import FloatArray
from config.cell.cell import CellConfig
from config.cell.plate import PlateLimits
from config.errors import ConfigError, DataQualityError
from config.formats.number import parse_numbers
from config.load import load_cell
from identification.calibration.base_reaction import base_load
from identification.estimation.estimate import Estimate
from identification.estimation.file import read_estimate
from identification.regression.fit_grade import BAD_SHARE, Grade
from identification.validation.base_wrench_validation import validate_base_wrench
from identification.validation.diagnosis import diagnose
from identification.validation.extrapolation import extrapolation_findings
from identification.validation.torque_prediction import Validation, validate_torques
from rid_daq.blocks.formats import number
from rid_daq.operations.cell_files import estimate_for, motion_for, require_robot
from rid_daq.operations.identify.validate import ValidateRequest
from rid_daq.report.model_file import ModelFile
from rid_daq.report.sections.curves import CurvesSection, TorqueCurves
from rid_daq.report.sections.estimate import EstimateSection
from rid_daq.report.sections.reaction import BaseLoadSection, ReactionSection
from rid_daq.report.sections.runs import ClockSection
from rid_daq.report.sections.validation import ValidationSection
from rid_daq.report.sections.verdict import VerdictCheck, VerdictSection
from rid_daq.report_page.write import write_result
from rid_daq.requests.request import refuse_unused
from rid_daq.runs.measured_torques import require_torques
from rid_daq.runs.run_data import RunData, clocks_of, every_lack, result_of
from rid_daq.terminal.console import as_command

SHORTEST_S: Final = 5.0
"""A verdict needs so many seconds of motion."""

OF_RUNS: Final = ("limits", "band_hz", "standstill_rad_s", "unfinished")
"""Fields of the request that apply to runs only."""


@dataclass(frozen=True)
class Validated:
    """A prediction and the verdict on it.

    Attributes:
        verdict: Whether the limits hold.
        validation: Torques; None of a motion file, which nobody has run.
        reaction: The reaction on the base against the plate's.
        base_load: The largest reaction on the base, where it is judged.
        notes: What the run lacks.
        clocks: Repeated, missing and jittered rows of the run, and where its times come from.
        report: The run's report.
        not_compared: Why the reaction on the base is not compared; empty if it is, or there is
            none.
    """

    verdict: VerdictSection
    validation: ValidationSection | None = None
    reaction: ReactionSection | None = None
    base_load: BaseLoadSection | None = None
    notes: list[str] | None = None
    clocks: list[ClockSection] | None = None
    report: Path | None = None
    not_compared: str = ""


@dataclass(frozen=True)
class JudgedTorques:
    """A prediction of a run and the verdict on it, before anything is written.

    Attributes:
        validation: Torques over time.
        section: The errors as reports show them.
        reaction, load, not_compared: As `Validated` has them.
    """

    validation: Validation
    section: ValidationSection
    verdict: VerdictSection
    reaction: ReactionSection | None
    load: BaseLoadSection | None
    not_compared: str


def validate_run(request: ValidateRequest) -> Validated:
    """Predict a run with a model, judge the error, and put it into the run's report.

    Raises:
        ConfigError: The limits are invalid, or are missing, or the model is of another robot.
        DataQualityError: The run allows no verdict: the model was identified from it, or it is too
            short.
        RidDaqError: The run or the model cannot be used.
    """
    if not request.model.exists() and Path(request.run).is_file():
        turned = as_command("validate", request.run, request.model)
        raise ConfigError(
            f"{request.run} is a file, not a run: the model comes first: {turned}",
            code="RID-RUN-IS-FILE",
        )
    estimate = read_estimate(request.model)
    data = RunData.load(find_run(request.runs, request.run), unfinished=request.unfinished)
    judged = judge_torques(request, estimate, data)
    notes = every_lack([data])
    result, model = result_of(data, notes), ModelFile.of(request.model)
    curves = (result.curves if result.model == model else None) or CurvesSection()
    torque = TorqueCurves.of(judged.validation, data.robot)
    result = result.with_model_sections(
        model,
        title=f"Validation of {estimate.robot.name}",
        validation=judged.section,
        estimate=EstimateSection.of(estimate),
        curves=curves.model_copy(update={"torque": torque}),
        reaction=judged.reaction,
        base_load=judged.load,
        verdict=judged.verdict,
    )
    report = write_result(data.folder, result)
    clocks = clocks_of([data])
    return Validated(
        judged.verdict,
        judged.section,
        judged.reaction,
        judged.load,
        notes,
        clocks,
        report,
        judged.not_compared,
    )


def judge_torques(request: ValidateRequest, estimate: Estimate, data: RunData) -> JudgedTorques:
    """Predict a run that was read, and judge the error; nothing is written.

    Args:
        request: The limits and what counts; the model's file is named in sentences only.
        estimate: The model.
        data: The run.

    Raises:
        ConfigError: The limits are invalid, or are missing, or the model is of another robot.
        DataQualityError: The run allows no verdict: the model was identified from it, or it is too
            short.
    """
    require_robot(request.model, estimate, data.robot)
    external = estimate.options.kind == "external"
    if external and request.limits is not None:
        raise ConfigError(
            "--limits: has no effect with an external model, which knows no friction; leave it out",
            code="RID-OPTION-NEEDS",
        )
    recovered_from = data.folder.manifest().facts.get("recovered_from")
    if data.folder.run_id in estimate.run_ids or recovered_from in estimate.run_ids:
        raise DataQualityError(
            f"{data.folder.path}: no verdict: the model was identified from this very run, which"
            " says nothing of other motions. Validate on a run that it has not seen",
            code="RID-VALIDATE-SAME-RUN",
        )
    if not external:
        require_torques([data])
    band_hz = request.band_hz or estimate.band_hz
    validation = validate_torques(
        estimate,
        data.recording,
        cutoff_hz=band_hz,
        standstill_rad_s=request.standstill_rad_s,
        limits_percent=None if external else _limits(request.limits, data),
        noise_nm=_noise(data),
    )
    _require_motion(validation, data)
    sentence = f"Run {data.folder.manifest().label!r} predicted by {request.model.name}."
    if not external and validation.limits_percent is None:
        validation = replace(validation, limits_percent=validation.default_limits_percent)
        sentence += (
            f" No limits were given: an error beyond {100.0 * BAD_SHARE:g} % of the torque and the"
            " noise fails."
        )
    if external:
        sentence += " The external model knows no friction: torques are not judged."
    section = ValidationSection.of(
        validation,
        data.robot,
        sentence,
        diagnosis=[
            *extrapolation_findings(estimate, validation.position),
            *(found.sentence for found in diagnose(estimate, validation)),
        ],
    )
    reaction, load, not_compared = None, None, ""
    if data.recording.reaction is not None and estimate.options.kind != "internal":
        try:
            compared = validate_base_wrench(estimate, data.recording, cutoff_hz=band_hz)
            reaction = ReactionSection.of(compared)
        except DataQualityError as error:
            not_compared = f"The reaction on the base is not compared: {error}"
    if request.base:
        limits = _limits_of(data.cell, "the run's cell file")
        motion = (validation.position, validation.velocity, validation.acceleration)
        load = BaseLoadSection.of(
            base_load(estimate, validation.time_s, *motion, limits, mass_kg=request.mass_kg)
        )
    verdict = _verdict(section, load, estimate.robot.name)
    return JudgedTorques(validation, section, verdict, reaction, load, not_compared)


def predict_motion(request: ValidateRequest) -> Validated:
    """Predict the reaction of a motion that nobody has run, and judge it.

    Raises:
        ConfigError: The reaction was not asked for, no cell is named or it has no limits, or the
            motion is for another robot or cannot be run.
        EstimationError: The model is an internal one.
    """
    motion = Path(request.run)
    refuse_unused(request, OF_RUNS, "with a motion file")
    if not request.base:
        raise ConfigError(
            f"{motion}: is a motion file: without a run only the reaction on the base can be judged"
            " (--base-limits); record it to judge torques",
            code="RID-OPTION-NEEDS",
        )
    if request.cell is None:
        raise ConfigError(
            f"{motion}: a motion file needs --cell, which says the limits and the cycle time",
            code="RID-OPTION-NEEDS",
        )
    cell = load_cell(request.cell)
    limits = _limits_of(cell.config, f"cell {cell.config.name}")
    estimate = estimate_for(request.model, cell.robot)
    asked = motion_for(motion, cell)
    samples = asked.plan(cell.robot, cell.config.cycle_time_s).whole()
    time_s = np.arange(len(samples), dtype=np.float64) * samples.sample_period_s
    moved = (samples.position, samples.velocity, samples.acceleration)
    load = BaseLoadSection.of(
        base_load(estimate, time_s, *moved, limits, mass_kg=request.mass_kg),
        " That is the motion as commanded: overshoot of the drives comes on top.",
    )
    passed = f"Passed: {motion.name} keeps the limits of the base"
    return Validated(_judged(load.checks, passed, load.sentence), base_load=load)


def _limits_of(cell: CellConfig | None, where: str) -> PlateLimits:
    """Return what a cell file, named by `where`, says that the floor may see."""
    limits = None if cell is None or cell.plate is None else cell.plate.limits
    if limits is None:
        raise ConfigError(
            f"--base-limits: {where} has no `plate` with `limits`; add force_n and moment_nm there",
            code="RID-PLATE-NO-LIMITS",
        )
    return limits


def _require_motion(validation: Validation, data: RunData) -> None:
    """Refuse a run whose motion is too short for a verdict."""
    period_s = np.median(np.diff(validation.time_s))
    moved_s = float(np.count_nonzero(validation.counted.any(axis=1)) * period_s)
    if moved_s < SHORTEST_S:
        raise DataQualityError(
            f"{data.folder.path}: no verdict: the run moves for {moved_s:.1f} s, a verdict needs"
            f" {SHORTEST_S:g} s of motion. Record a longer one",
            code="RID-RUN-STILL",
        )


def _noise(data: RunData) -> FloatArray | None:
    """Return the noise of one torque sample as periods show it; None where there are none."""
    if not data.is_periodic:
        return None
    try:
        return np.asarray(np.sqrt(data.average.torque_variance))
    except DataQualityError:
        return None


def _limits(text: str | None, data: RunData) -> tuple[float, ...] | None:
    """Return the limit of every axis: those given, or the cell file's; None without either."""
    if text is None:
        return None if data.cell is None else data.cell.validation_limits_percent
    count = len(data.robot.joints)
    try:
        values = parse_numbers(text)
    except ConfigError:
        values = ()
    if len(values) not in (1, count) or not all(0.0 < value < 1e6 for value in values):
        raise ConfigError(
            f"--limits {text}: give one percentage, or {count} separated by commas, such as"
            f" {','.join(['10'] * count)}",
            code="RID-OPTION-COUNT",
        )
    return values * (count if len(values) == 1 else 1)


def _verdict(
    section: ValidationSection, load: BaseLoadSection | None, robot: str
) -> VerdictSection:
    checks = [
        VerdictCheck.of(
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
        return VerdictSection.of([], "Torques predicted, and not judged", sentence)
    doubtful = [axis.joint for axis in section.axes if axis.grade is Grade.DOUBTFUL]
    doubt = f"; the fit of {', '.join(doubtful)} is doubtful" if doubtful else ""
    return _judged(checks, f"Passed: the model of {robot} predicts this run{doubt}", sentence)


def _judged(checks: Sequence[VerdictCheck], passed: str, sentence: str) -> VerdictSection:
    """Return a verdict whose headline names what is beyond its limit."""
    failed = [line.text.rsplit(" ", 1)[-1] for line in checks if not line.passed]
    headline = f"Failed: {', '.join(failed)} beyond the limit" if failed else passed
    return VerdictSection.of(checks, headline, sentence)
