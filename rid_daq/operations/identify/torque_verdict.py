"""`validate_recording`, `validate_together`: predict the torques of runs, and check the limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.cell.cell import CellConfig
from config.cell.plate import PlateLimits
from config.errors import ConfigError, DataQualityError
from config.formats.number import parse_numbers
from config.robot.robot import RobotDescription
from identification.accuracy.extrapolation import extrapolation_findings, repetition_findings
from identification.calibration.base_reaction import base_load
from identification.elasticity.gear_torque import describe_gear_torque
from identification.estimation.estimate import Estimate
from identification.regression.fit_grade import BAD_SHARE, Grade
from identification.validation.base_wrench_validation import (
    pool_base_wrenches,
    validate_base_wrench,
)
from identification.validation.diagnosis import diagnose
from identification.validation.torque_prediction import (
    Validation,
    pool_validations,
    validate_torques,
)
from rid_daq.blocks.formats import number
from rid_daq.operations.cell_files import refuse_other_robot
from rid_daq.operations.identify.validate import ValidateRequest
from rid_daq.operations.stated_payload import payload_words
from rid_daq.report.sections.plate import BaseLoadSection, ReactionSection
from rid_daq.report.sections.validation import RunErrors, ValidationSection
from rid_daq.report.sections.verdict import VerdictCheck, VerdictSection
from rid_daq.requests.request import refuse_unused
from rid_daq.runs.measured_torques import require_torques
from rid_daq.runs.repeated_imports import refuse_repeated_imports, share_of_samples
from rid_daq.runs.run_data import RunData

SHORTEST_S: Final = 5.0
"""Shortest motion that allows a verdict [s]."""


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
        EstimationError, RecordingError: The model cannot predict the run, or the run is damaged.
    """
    validation = _predict_torques(request, estimate, data)
    if (moved_s := _time_in_motion_s(validation)) < SHORTEST_S:
        raise _too_short(str(data.folder.path), moved_s)
    by = f"{request.model.name}{payload_words(request.payload)}"
    section, validation = _torque_section(
        validation,
        estimate,
        data.robot,
        f"Run {data.folder.manifest().label!r}, predicted by {by}.",
    )
    reaction, not_compared = _compare_wrench(request, estimate, [data])
    load = None
    if request.base:
        limits = required_plate_limits(data.cell, "the run's cell file")
        motion = (validation.position, validation.velocity, validation.acceleration)
        load = BaseLoadSection.of(
            base_load(estimate, validation.time_s, *motion, limits, mass_kg=request.mass_kg)
        )
    verdict = _validation_verdict(section, reaction, load, estimate)
    return TorqueVerdict(validation, section, verdict, reaction, load, not_compared)


def validate_together(
    request: ValidateRequest, estimate: Estimate, runs: Sequence[RunData]
) -> tuple[tuple[RunErrors, ...], TorqueVerdict]:
    """Predict several runs and check the limits on all of them together; nothing is written.

    Args:
        request: Limits and options; `model` only names the model in messages.
        estimate: The model.
        runs: The runs; a run can be shorter than one that is judged alone.

    Returns:
        The errors of each run, and the result for all runs together. The reaction on the base is
        compared if every run has a force plate.

    Raises:
        ConfigError: The runs' cells have different limits, or as for `validate_recording`.
        DataQualityError, EstimationError, RecordingError: As for `validate_recording`; the time of
            motion is that of all runs.
    """
    refuse_unused(request, ("base", "mass_kg"), "with several runs")
    refuse_repeated_imports(runs)
    for each in runs:
        refuse_other_robot(request.model, estimate.robot, each.robot)
    external = estimate.options.kind == "external"
    limits = {None if external else _torque_limits_percent(request.limits, each) for each in runs}
    if len(limits) > 1:
        raise ConfigError(
            "the cells of the runs have different `validation_limits_percent`: give --limits",
            code="RID-OPTION-NEEDS",
        )
    parts = [_predict_torques(request, estimate, each) for each in runs]
    moved_s = sum(map(_time_in_motion_s, parts))
    if moved_s < SHORTEST_S:
        raise _too_short(f"{len(runs)} runs", moved_s)
    labels = [each.folder.manifest().label or each.folder.run_id for each in runs]
    robot, by = runs[0].robot, f"{request.model.name}{payload_words(request.payload)}"
    section, whole = _torque_section(
        pool_validations(parts, limits.pop()),
        estimate,
        robot,
        f"{len(runs)} runs together ({', '.join(labels)}), predicted by {by}.",
    )
    each_run = tuple(
        RunErrors.of(label, part, robot) for label, part in zip(labels, parts, strict=True)
    )
    reaction, not_compared = _compare_wrench(request, estimate, runs)
    verdict = _validation_verdict(section, reaction, None, estimate, "these runs")
    return each_run, TorqueVerdict(whole, section, verdict, reaction, None, not_compared)


def _predict_torques(request: ValidateRequest, estimate: Estimate, data: RunData) -> Validation:
    """Return the prediction of a run that may be used for a verdict."""
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
    if share := share_of_samples(estimate.imported_row_hashes, data):
        raise DataQualityError(
            f"{data.folder.path}: no verdict: this run contains at least {100.0 * share:.0f} % of"
            " the rows from which the model was identified, imported again. Validate with rows that"
            " were not used for the estimate",
            code="RID-VALIDATE-SAME-RUN",
        )
    if not external:
        require_torques([data])
    return validate_torques(
        estimate,
        data.recording,
        cutoff_hz=request.band_hz or estimate.band_hz,
        standstill_rad_s=request.standstill_rad_s,
        limits_percent=None if external else _torque_limits_percent(request.limits, data),
        noise_nm=_torque_noise(data),
    )


def _compare_wrench(
    request: ValidateRequest, estimate: Estimate, runs: Sequence[RunData]
) -> tuple[ReactionSection | None, str]:
    """Return the errors of the base wrench on all runs, or the reason why they are unknown.

    The reason is empty if no run has a force plate, or if the model does not predict the wrench.
    """
    without = [each.folder.path for each in runs if each.recording.reaction is None]
    if estimate.options.kind == "internal" or len(without) == len(runs):
        return None, ""
    if without:
        return None, f"The reaction on the base is not compared: {without[0]} has no force plate."
    band_hz = request.band_hz or estimate.band_hz
    try:
        parts = [validate_base_wrench(estimate, each.recording, cutoff_hz=band_hz) for each in runs]
    except DataQualityError as error:
        return None, f"The reaction on the base is not compared: {error}"
    return ReactionSection.of(pool_base_wrenches(parts) if len(parts) > 1 else parts[0]), ""


def required_plate_limits(cell: CellConfig | None, where: str) -> PlateLimits:
    """Return the limits of the reaction on the base from a cell file.

    Args:
        cell: The cell; None without a cell.
        where: Name of the cell file, for the error message.

    Raises:
        ConfigError: The cell has no such limits.
    """
    limits = None if cell is None or cell.plate is None else cell.plate.limits
    if limits is None:
        raise ConfigError(
            f"--base-limits: {where} has no `plate` with `limits`; add force_n and moment_nm there",
            code="RID-PLATE-NO-LIMITS",
        )
    return limits


def verdict_of_checks(
    checks: Sequence[VerdictCheck], passed: str, sentence: str, estimate: Estimate
) -> VerdictSection:
    """Return a verdict whose headline names the joints and components beyond their limits.

    A model that `identify` rejected always fails.
    """
    failed = [line.text.rsplit(" ", 1)[-1] for line in checks if not line.passed]
    exceed = "exceeds" if len(failed) == 1 else "exceed"
    headline = f"Failed: {', '.join(failed)} {exceed} the limit" if failed else passed
    if estimate.objections:
        headline = headline if failed else "Failed: `identify` rejected this model"
        words = f"{sentence} `identify` rejected this model. {' '.join(estimate.objections)}"
        return VerdictSection.failed(headline, words).model_copy(update={"checks": tuple(checks)})
    return VerdictSection.of(checks, headline, sentence)


def _time_in_motion_s(validation: Validation) -> float:
    """Return the total time in which at least one axis counts for the errors [s]."""
    period_s = np.median(np.diff(validation.time_s))
    return float(np.count_nonzero(validation.counted.any(axis=1)) * period_s)


def _too_short(what: str, moved_s: float) -> DataQualityError:
    return DataQualityError(
        f"{what}: no verdict: the robot moves for {moved_s:.1f} s, but a verdict needs"
        f" {SHORTEST_S:g} s of motion. Record a longer motion, or validate several runs together",
        code="RID-RUN-STILL",
    )


def _torque_section(
    validation: Validation, estimate: Estimate, robot: RobotDescription, sentence: str
) -> tuple[ValidationSection, Validation]:
    """Return the errors as a section, and the validation with the limits that apply."""
    external = estimate.options.kind == "external"
    if not external and validation.limits_percent is None:
        validation = replace(validation, limits_percent=validation.default_limits_percent)
        sentence += (
            f" No limits were given, so the default applies: {100.0 * BAD_SHARE:g} % of the"
            " torque, combined with its noise (root of the sum of squares)."
        )
    if external:
        sentence += (
            " The external model contains no friction, so the torques get no verdict; the base"
            " wrench of a force plate does."
        )
    if (gear_torque := validation.gear_torque_nm) is not None:
        sentence += (
            " The model is that of the links behind elastic gears: their motion was computed from"
            " that of the motors with the stiffness in the model file. With rigid gears, the"
            f" prediction would differ by {describe_gear_torque(robot, gear_torque)}."
        )
    diagnosis = [
        *repetition_findings(estimate, validation.position),
        *extrapolation_findings(estimate, validation.position),
    ]
    if not external:  # without friction in the model, it would find friction only
        diagnosis += [found.sentence for found in diagnose(estimate, validation)]
    return ValidationSection.of(validation, robot, sentence, diagnosis=diagnosis), validation


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
    except ConfigError as error:
        raise ConfigError(f"--limits {text}: {error}", code="RID-OPTION-SYNTAX") from error
    if not all(0.0 < value < 1e6 for value in values):
        raise ConfigError(
            f"--limits {text}: give percentages above 0 and below 1e6", code="RID-OPTION-RANGE"
        )
    if len(values) not in (1, count):
        raise ConfigError(
            f"--limits {text}: give one percentage, or {count} separated by commas, such as"
            f" {','.join(['10'] * count)}",
            code="RID-OPTION-COUNT",
        )
    return values * (count if len(values) == 1 else 1)


def _validation_verdict(
    section: ValidationSection,
    reaction: ReactionSection | None,
    load: BaseLoadSection | None,
    estimate: Estimate,
    what: str = "this run",
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
    checks += [] if reaction is None else reaction.checks
    checks += [] if load is None else load.checks
    errors = ", ".join(f"{number(axis.relative_error_percent, 3)}" for axis in section.axes)
    sentence = f"Relative torque error of each axis: {errors} %."
    if not checks and not estimate.objections:
        return VerdictSection.of([], "Torques predicted; no limits, so no verdict", sentence)
    robot = estimate.robot.name
    doubtful = [axis.joint for axis in section.axes if axis.grade is Grade.DOUBTFUL]
    doubt = f"; the fit of {', '.join(doubtful)} is doubtful" if doubtful else ""
    return verdict_of_checks(
        checks, f"Passed: the model of {robot} predicts {what}{doubt}", sentence, estimate
    )
