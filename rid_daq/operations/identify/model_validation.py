"""`validate_run`, `predict_motion`: predict torques and base reactions, and check the limits."""

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
from rid_daq.operations.cell_files import read_estimate_for, read_motion_for, refuse_other_robot
from rid_daq.operations.identify.validate import ValidateRequest
from rid_daq.operations.stated_payload import payload_words, state_payload
from rid_daq.report.model_file import ModelFile
from rid_daq.report.sections.curves import CurvesSection, TorqueCurves
from rid_daq.report.sections.estimate import EstimateSection
from rid_daq.report.sections.plate import BaseLoadSection, ReactionSection
from rid_daq.report.sections.runs import ClockSection
from rid_daq.report.sections.validation import ValidationSection
from rid_daq.report.sections.verdict import VerdictCheck, VerdictSection
from rid_daq.report_page.write import write_result
from rid_daq.requests.request import refuse_unused
from rid_daq.runs.measured_torques import require_torques
from rid_daq.runs.run_data import RunData, all_defects, clock_sections, result_of
from rid_daq.terminal.console import as_command

SHORTEST_S: Final = 5.0
"""Shortest motion that allows a verdict [s]."""

OF_RUNS: Final = ("limits", "band_hz", "standstill_rad_s", "unfinished")
"""Fields of the request that apply to runs only."""


@dataclass(frozen=True)
class ValidatedModel:
    """A prediction and the verdict on it.

    Attributes:
        verdict: Verdict on the limits.
        validation: Torque errors; None for a motion file, which has no recording.
        reaction: Predicted and measured reaction on the force plate.
        base_load: Largest reaction on the base, if the request asks for it.
        notes: Defects of the run's data.
        clocks: Repeated, missing and jittered rows of the run, and the source of its times.
        report: Path of the run's report.
        not_compared: Reason if the reaction on the base cannot be compared; otherwise empty.
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
class TorqueVerdict:
    """Prediction of a run and the verdict on it, before anything is written.

    Attributes:
        validation: Measured and predicted torques over time.
        section: Errors as a section of a report.
        verdict: Verdict on the limits.
        reaction, load, not_compared: As in `ValidatedModel`.
    """

    validation: Validation
    section: ValidationSection
    verdict: VerdictSection
    reaction: ReactionSection | None
    load: BaseLoadSection | None
    not_compared: str


def validate_run(request: ValidateRequest) -> ValidatedModel:
    """Predict a run with a model, check the limits, and add the result to the run's report.

    Raises:
        ConfigError: The limits are invalid or missing, or the model is of another robot.
        DataQualityError: The run allows no verdict: the model was identified from it, or it is too
            short.
        RidDaqError: The run or the model cannot be used.
    """
    if not request.model.exists() and Path(request.run).is_file():
        turned = as_command("validate", request.run, request.model)
        raise ConfigError(
            f"{request.run} is a file, not a run: give the model first, then the run: {turned}",
            code="RID-RUN-IS-FILE",
        )
    estimate = _stated_model(request, read_estimate(request.model))
    data = RunData.load(find_run(request.runs, request.run), unfinished=request.unfinished)
    judged = validate_recording(request, estimate, data)
    notes = all_defects([data])
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
    clocks = clock_sections([data])
    return ValidatedModel(
        judged.verdict,
        judged.section,
        judged.reaction,
        judged.load,
        notes,
        clocks,
        report,
        judged.not_compared,
    )


def validate_recording(
    request: ValidateRequest, estimate: Estimate, data: RunData
) -> TorqueVerdict:
    """Predict a run and check the limits; nothing is written.

    Args:
        request: Limits and options; `model` only names the model in messages.
        estimate: The model.
        data: The run.

    Raises:
        ConfigError: The limits are invalid or missing, or the model is of another robot.
        DataQualityError: The run allows no verdict: the model was identified from it, or it is too
            short.
    """
    refuse_other_robot(request.model, estimate.robot, data.robot)
    external = estimate.options.kind == "external"
    if external and request.limits is not None:
        raise ConfigError(
            "--limits has no effect with an external model, because it contains no friction;"
            " leave it out",
            code="RID-OPTION-NO-EFFECT",
        )
    recovered_from = data.folder.manifest().facts.get("recovered_from")
    if data.folder.run_id in estimate.run_ids or recovered_from in estimate.run_ids:
        raise DataQualityError(
            f"{data.folder.path}: no verdict: the model was identified from this run, so the run"
            " does not show the error on other motions. Validate with a run that was not used"
            " for the estimate",
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
        limits_percent=None if external else _torque_limits_percent(request.limits, data),
        noise_nm=_torque_noise(data),
    )
    _require_motion(validation, data)
    by = f"{request.model.name}{payload_words(request.payload)}"
    sentence = f"Run {data.folder.manifest().label!r}, predicted by {by}."
    if not external and validation.limits_percent is None:
        validation = replace(validation, limits_percent=validation.default_limits_percent)
        sentence += (
            f" No limits were given, so the default applies: {100.0 * BAD_SHARE:g} % of the"
            " torque, combined with its noise (root of the sum of squares)."
        )
    if external:
        sentence += " The external model contains no friction, so the torques get no verdict."
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
        limits = _base_limits(data.cell, "the run's cell file")
        motion = (validation.position, validation.velocity, validation.acceleration)
        load = BaseLoadSection.of(
            base_load(estimate, validation.time_s, *motion, limits, mass_kg=request.mass_kg)
        )
    verdict = _validation_verdict(section, load, estimate.robot.name)
    return TorqueVerdict(validation, section, verdict, reaction, load, not_compared)


def predict_motion(request: ValidateRequest) -> ValidatedModel:
    """Predict the reaction on the base of a motion file, and compare it with the limits.

    Raises:
        ConfigError: The request does not ask for the reaction, it names no cell or a cell without
            limits, or the motion is for another robot or exceeds its limits.
        EstimationError: The model is internal, so it cannot predict the reaction.
    """
    motion = Path(request.run)
    refuse_unused(request, OF_RUNS, "with a motion file")
    if not request.base:
        raise ConfigError(
            f"{motion} is a motion file: without a recording only the reaction on the base can be"
            " validated (--base-limits); record the motion to validate torques",
            code="RID-OPTION-NEEDS",
        )
    if request.cell is None:
        raise ConfigError(
            f"{motion}: a motion file needs --cell, for the limits and the cycle time",
            code="RID-OPTION-NEEDS",
        )
    cell = load_cell(request.cell)
    limits = _base_limits(cell.config, f"cell {cell.config.name}")
    estimate = _stated_model(request, read_estimate_for(request.model, cell.robot))
    asked = read_motion_for(motion, cell)
    samples = asked.plan(cell.robot, cell.config.cycle_time_s).whole()
    time_s = np.arange(len(samples), dtype=np.float64) * samples.sample_period_s
    moved = (samples.position, samples.velocity, samples.acceleration)
    load = BaseLoadSection.of(
        base_load(estimate, time_s, *moved, limits, mass_kg=request.mass_kg),
        " This is the reaction of the commanded motion; overshoot of the drives increases it.",
    )
    passed = f"Passed: {motion.name} keeps the limits of the reaction on the base"
    return ValidatedModel(_verdict_of_checks(load.checks, passed, load.sentence), base_load=load)


def _stated_model(request: ValidateRequest, estimate: Estimate) -> Estimate:
    return state_payload(estimate, request.model, request.payload, request.runs).estimate


def _base_limits(cell: CellConfig | None, where: str) -> PlateLimits:
    """Return the limits of the reaction on the base from a cell file.

    Args:
        cell: The cell; None without a cell.
        where: Name of the cell file, for the error message.
    """
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
            f"{data.folder.path}: no verdict: the robot moves for {moved_s:.1f} s, but a verdict"
            f" needs {SHORTEST_S:g} s of motion. Record a longer motion",
            code="RID-RUN-STILL",
        )


def _torque_noise(data: RunData) -> FloatArray | None:
    """Return the noise of one torque sample, from the scatter of periods; None without periods."""
    if not data.is_periodic:
        return None
    try:
        return np.asarray(np.sqrt(data.average.torque_variance))
    except DataQualityError:
        return None


def _torque_limits_percent(text: str | None, data: RunData) -> tuple[float, ...] | None:
    """Return the limits of all axes, from `text` or else from the cell file; None without any."""
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


def _validation_verdict(
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
    sentence = f"Relative torque error of each axis: {errors} %."
    if not checks:
        return VerdictSection.of([], "Torques predicted; no limits, so no verdict", sentence)
    doubtful = [axis.joint for axis in section.axes if axis.grade is Grade.DOUBTFUL]
    doubt = f"; the fit of {', '.join(doubtful)} is doubtful" if doubtful else ""
    return _verdict_of_checks(
        checks, f"Passed: the model of {robot} predicts this run{doubt}", sentence
    )


def _verdict_of_checks(
    checks: Sequence[VerdictCheck], passed: str, sentence: str
) -> VerdictSection:
    """Return a verdict whose headline names the quantities beyond their limits."""
    failed = [line.text.rsplit(" ", 1)[-1] for line in checks if not line.passed]
    headline = f"Failed: {', '.join(failed)} exceed the limit" if failed else passed
    return VerdictSection.of(checks, headline, sentence)
