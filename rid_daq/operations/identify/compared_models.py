"""`compare_models`: compute the differences of two estimates and their torque errors on runs."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

from acquisition.runs.catalogue import find_file_or_run, find_run
from acquisition.runs.folder import RunFolder
from config.arrays import FloatArray
from config.errors import ConfigError
from identification.elasticity.gear_torque import describe_gear_torque
from identification.estimation.estimate import Estimate
from identification.validation.estimate_difference import EstimateDifference, compare_estimates
from identification.validation.torque_prediction import common_relative_errors, validate_torques
from rid_daq.operations.cell_files import refuse_other_robot
from rid_daq.operations.identify.compare import CompareRequest
from rid_daq.operations.stated_payload import state_payload
from rid_daq.runs.measured_torques import require_torques
from rid_daq.runs.repeated_imports import share_of_samples
from rid_daq.runs.run_data import RunData, all_defects
from rid_daq.runs.run_model import read_model
from rid_daq.terminal.choices import MODEL


@dataclass(frozen=True, eq=False)
class RunPrediction:
    """Torque errors of both models on one run.

    Attributes:
        data: The run.
        identified_from: For each model, True if it was identified from this run.
        percent: Shape (2, n). Relative torque errors on samples that count for both models [%]; NaN
            for an axis that did not move.
    """

    data: RunData
    identified_from: tuple[bool, bool]
    percent: FloatArray


@dataclass(frozen=True)
class ComparedModels:
    """Result of a comparison of two models.

    Attributes:
        names: Names of the two models.
        difference: Differences of their parameters.
        predictions: Torque errors, one entry per run.
        notes: Defects of the runs' data; a note if only one of the models assumes rigid gears.
    """

    names: tuple[str, str]
    difference: EstimateDifference
    predictions: list[RunPrediction]
    notes: list[str]


def compare_models(request: CompareRequest) -> ComparedModels:
    """Compare two estimates, and predict the torques of runs with both.

    Raises:
        ConfigError: A run has no model, or models and runs are of different robots.
        RidDaqError: A run or a model cannot be used.
    """
    first, first_estimate, first_run = _load_side(request, request.first)
    second, second_estimate, second_run = _load_side(request, request.second)
    difference = compare_estimates(first_estimate, second_estimate)
    predicted_runs = [data for data in (first_run, second_run) if data is not None]
    if request.on is not None:
        folder = find_run(request.runs, request.on)
        predicted_runs = [RunData.load(folder, unfinished=request.unfinished)]
    notes = all_defects(predicted_runs)
    notes += _gear_notes([(first, first_estimate), (second, second_estimate)])
    for data, (name, estimate) in itertools.product(
        predicted_runs, [(first, first_estimate), (second, second_estimate)]
    ):
        refuse_other_robot(Path(name), estimate.robot, data.robot)
    require_torques(predicted_runs)
    if predicted_runs or request.payload is not None:
        first_estimate, second_estimate = (
            state_payload(estimate, name, request.payload, request.runs).estimate
            for estimate, name in ((first_estimate, first), (second_estimate, second))
        )
    predictions = [_predict_run(first_estimate, second_estimate, data) for data in predicted_runs]
    return ComparedModels((first, second), difference, predictions, notes)


def named_runs(request: CompareRequest) -> tuple[RunFolder, RunFolder] | None:
    """Return the two runs of a request; None if it names a model file.

    Raises:
        ConfigError, RecordingError: A name is neither a file nor a run.
    """
    first, second = (
        find_file_or_run(request.runs, each) for each in (request.first, request.second)
    )
    if isinstance(first, Path) or isinstance(second, Path):
        return None
    return first, second


def _load_side(request: CompareRequest, what: str) -> tuple[str, Estimate, RunData | None]:
    """Return name and estimate of a model file, or of a run with the model identified from it."""
    folder = find_file_or_run(request.runs, what)
    if isinstance(folder, Path):
        return folder.name, read_model(folder), None
    if not folder.file(MODEL).exists():
        raise ConfigError(
            f"run {what!r} has no {MODEL}: identify it first with `rid-daq identify {folder.path}`",
            code="RID-RUN-NO-RESULT",
        )
    data = RunData.load(folder, unfinished=request.unfinished)
    return folder.manifest().label, read_model(folder.file(MODEL)), data


def _gear_notes(models: list[tuple[str, Estimate]]) -> list[str]:
    """Return a note if one of two models assumes rigid gears and the other does not."""
    elastic = [
        (name, each.robot, each.gear_torque_nm)
        for name, each in models
        if each.gear_torque_nm is not None
    ]
    if len(elastic) != 1:
        return []
    name, robot, torque_nm = elastic[0]
    words = describe_gear_torque(robot, torque_nm)
    return [
        f"{name} is a model of the links behind elastic gears; the other model assumes rigid gears,"
        " so it contains the deflection as additional inertia. Parameters can therefore differ. The"
        f" deflection changed the torques of the runs of {name} by {words}"
    ]


def _predict_run(one: Estimate, other: Estimate, data: RunData) -> RunPrediction:
    used = [
        data.folder.run_id in each.run_ids or share_of_samples(each.imported_row_hashes, data) > 0.0
        for each in (one, other)
    ]
    found = [
        validate_torques(each, data.recording, cutoff_hz=each.band_hz) for each in (one, other)
    ]
    return RunPrediction(data, (used[0], used[1]), common_relative_errors(*found))
