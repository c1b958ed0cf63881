"""`validate_run`, `predict_motion`: predict torques and base reactions, and check the limits."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.runs.catalogue import find_run, find_runs
from config.errors import ConfigError
from config.load import load_cell
from identification.calibration.base_reaction import base_load
from identification.estimation.estimate import Estimate
from rid_daq.operations.cell_files import read_estimate_for, read_motion_for
from rid_daq.operations.identify.torque_verdict import (
    required_plate_limits,
    validate_recording,
    validate_together,
    verdict_of_checks,
)
from rid_daq.operations.identify.validate import ValidateRequest
from rid_daq.operations.stated_payload import state_payload
from rid_daq.report.model_file import ModelFile
from rid_daq.report.sections.curves import CurvesSection, TorqueCurves
from rid_daq.report.sections.estimate import EstimateSection
from rid_daq.report.sections.plate import BaseLoadSection, ReactionSection
from rid_daq.report.sections.runs import ClockSection
from rid_daq.report.sections.validation import RunErrors, ValidationSection
from rid_daq.report.sections.verdict import VerdictSection
from rid_daq.report_page.write import write_result
from rid_daq.requests.request import refuse_unused
from rid_daq.runs.run_data import RunData, all_defects, clock_sections, result_of
from rid_daq.runs.run_model import read_model
from rid_daq.terminal.console import as_command

OF_RUNS: Final = ("further", "limits", "band_hz", "standstill_rad_s", "unfinished")
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
        clocks: Repeated, missing and jittered rows of each run, and the source of its times.
        report: Path of the run's report.
        not_compared: Reason if the reaction on the base cannot be compared; otherwise empty.
        runs: Errors of each run, if several runs were judged together.
    """

    verdict: VerdictSection
    validation: ValidationSection | None = None
    reaction: ReactionSection | None = None
    base_load: BaseLoadSection | None = None
    notes: list[str] | None = None
    clocks: list[ClockSection] | None = None
    report: Path | None = None
    not_compared: str = ""
    runs: tuple[RunErrors, ...] | None = None


def validate_run(request: ValidateRequest) -> ValidatedModel:
    """Predict a run with a model, check the limits, and add the result to the run's report.

    Several runs are judged together instead (`validate_together`), and no report changes.

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
    estimate = _stated_model(request, read_model(request.model))
    if request.further:
        folders = find_runs(request.runs, [request.run, *request.further])
        several = [RunData.load(each, unfinished=request.unfinished) for each in folders]
        runs, judged = validate_together(request, estimate, several)
        notes, clocks = all_defects(several), clock_sections(several)
        return ValidatedModel(
            judged.verdict,
            judged.section,
            judged.reaction,
            notes=notes,
            clocks=clocks,
            not_compared=judged.not_compared,
            runs=runs,
        )
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


def predict_motion(request: ValidateRequest) -> ValidatedModel:
    """Predict the reaction on the base of a motion file, and compare it with the limits.

    Raises:
        ConfigError: The request does not ask for the reaction, it names no cell or a cell without
            limits, or the motion is for another robot or exceeds its limits.
        EstimationError: The model is internal, so it cannot predict the reaction; or the model or
            its payload cannot be used.
        RecordingError: The model is in a damaged run, or the payload's run cannot be read.
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
    limits = required_plate_limits(cell.config, f"cell {cell.config.name}")
    estimate = _stated_model(
        request, read_estimate_for(request.model, cell.robot, despite_misfit=True)
    )
    asked = read_motion_for(motion, cell)
    samples = asked.plan(cell.robot, cell.config.cycle_time_s).whole()
    time_s = np.arange(len(samples), dtype=np.float64) * samples.sample_period_s
    moved = (samples.position, samples.velocity, samples.acceleration)
    load = BaseLoadSection.of(
        base_load(estimate, time_s, *moved, limits, mass_kg=request.mass_kg),
        " This is the reaction of the commanded motion; overshoot of the drives increases it.",
    )
    passed = f"Passed: {motion.name} keeps the limits of the reaction on the base"
    return ValidatedModel(
        verdict_of_checks(load.checks, passed, load.sentence, estimate), base_load=load
    )


def _stated_model(request: ValidateRequest, estimate: Estimate) -> Estimate:
    return state_payload(estimate, request.model, request.payload, request.runs).estimate
