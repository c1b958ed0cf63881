"""Estimate a payload from run folders, with its verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from acquisition.processing.periods import PeriodAverage
from acquisition.runs.folder import RunFolder
from config.errors import ConfigError
from identification.accuracy.rounded_positions import NOISE_SHARE_LIMIT, RoundedPositions
from identification.choices import BAND_HZ, STANDSTILL_RAD_S, PayloadLimits
from identification.elasticity.gear_torque import has_stiffness
from identification.equations.deconvolution import smoothed_recording
from identification.estimation.estimate import Estimate
from identification.estimation.options import EstimationOptions
from identification.payload.measured_runs import MeasuredRuns
from identification.payload.periodic_runs import PeriodicRuns
from identification.payload.procedures import PayloadOptions, identify_payload, mass_left_on_flange
from identification.payload.rigid_runs import gears_bend, rigid_runs
from identification.payload.smoothed_runs import SmoothedRuns
from identification.payload.verdict import (
    BAD_FIT,
    HEAVY,
    ROUNDED,
    PayloadCheck,
    PayloadResult,
    Repeats,
    check_payload,
    estimate_each_run,
)
from identification.wiring.search import find_impossibilities
from identification.wiring.weight import ArmWeight
from rid_daq.operations.estimation.rounded_runs import find_rounded_positions
from rid_daq.operations.estimation.run_estimation import EstimationJob, require_one_robot
from rid_daq.operations.estimation.wiring_diagnosis import signals_for_diagnosis
from rid_daq.operations.payload.shared import IdentifiedPayload
from rid_daq.operations.rigid_gears import RIGID_GEARS
from rid_daq.report.result import Result
from rid_daq.report.sections.payload import EmptyFlange, PayloadSection, payload_verdict
from rid_daq.report_page.write import write_result
from rid_daq.runs.output_file import register_output
from rid_daq.runs.run_data import RunData


@dataclass(frozen=True)
class PayloadRequest:
    """Options of a payload estimate.

    Attributes:
        how: Procedure, terms of the model, and known quantities.
        limits: Largest intervals and residuals with which the payload passes.
        band_hz: Highest frequency used.
        standstill_rad_s: Lowest speed used for friction.
    """

    how: PayloadOptions = field(default_factory=PayloadOptions)
    limits: PayloadLimits = field(default_factory=PayloadLimits)
    band_hz: float = BAND_HZ
    standstill_rad_s: float = STANDSTILL_RAD_S

    @property
    def time_domain_effects(self) -> str:
        """Effects in the robot's model that cannot be applied to mean periods, as a phrase.

        Empty if the model has no such effects. If it has, the runs are used as recorded instead of
        as mean periods, and only after they are complete.
        """
        model = self.how.robot
        if model is None:
            return ""
        if model.warming is not None:
            return "the warming of the joints"
        narrow = model.channel is not None and model.channel.filters
        return "a low-pass filter of the torques" if narrow else ""


def payload_runs(
    data: Sequence[RunData], loaded: Sequence[bool], payload_request: PayloadRequest
) -> MeasuredRuns:
    """Return the input of the estimators: averaged periods, or smoothed recordings.

    The delays and filters of the torques and the warming of the joints in the robot's model are
    applied to the runs too. Filters and warming can be applied in time only, not to a mean period.

    Raises:
        ConfigError: The runs are of different robots, or only some are periodic.
        DataQualityError, EstimationError: A run is too short or too damaged, or cannot be filtered.
        RecordingError: A recording cannot be read.
    """
    require_one_robot(data)
    model = payload_request.how.robot
    if data[0].is_periodic and not payload_request.time_domain_effects:
        return periodic_runs([item.average for item in data], loaded, payload_request)
    signals = [smoothed_recording(item.recording, payload_request.band_hz) for item in data]
    if model is not None and model.channel is not None:
        signals = [replace(each, channel=model.channel) for each in signals]
    if model is not None and model.warming is not None:
        signals = [model.warming.with_temperatures(model.robot, each) for each in signals]
    return SmoothedRuns(tuple(signals), tuple(loaded), payload_request.standstill_rad_s)


def periodic_runs(
    averages: Sequence[PeriodAverage], loaded: Sequence[bool], payload_request: PayloadRequest
) -> PeriodicRuns:
    """Return mean periods as input of the estimators; delays known from a model are removed."""
    model = payload_request.how.robot
    if model is not None and model.channel is not None:
        averages = [model.channel.undelayed_period(each) for each in averages]
    return PeriodicRuns(
        tuple(averages), tuple(loaded), payload_request.band_hz, payload_request.standstill_rad_s
    )


def estimate_payload(
    data: Sequence[RunData], loaded: Sequence[bool], payload_request: PayloadRequest
) -> tuple[PayloadResult, Repeats | None]:
    """Return a payload with its verdict, and the estimates of each run alone; nothing is written.

    Args:
        data: The runs.
        loaded: For each run, True if it carried the payload.
        payload_request: Options of the estimate.

    Raises:
        ConfigError: The runs are of different robots, only some are periodic, or the model was
            identified from a run with the payload.
        DataQualityError, EstimationError: The data do not determine a payload.
        RecordingError: A recording cannot be read.
    """
    how, robot = payload_request.how, data[0].robot
    if how.robot is not None:
        _refuse_runs_of_model(data, loaded, how.robot)
    rounded = find_rounded_positions(data, payload_request.band_hz)
    if rounded is not None:
        payload_request = replace(payload_request, band_hz=rounded.band_hz)
    runs = rigid_runs(robot, payload_runs(data, loaded, payload_request), how)
    estimate = identify_payload(
        robot,
        runs,
        how,
        cell_name=data[0].tally.head.cell_name,
        run_ids=tuple(item.folder.run_id for item in data),
    )
    repeats = None
    if how.procedure != "difference" and estimate.rank == len(estimate.values):
        repeats = estimate_each_run(robot, runs, how)
    left_on = mass_left_on_flange(robot, runs.part(_comparison_runs(data, loaded, how)), how)
    held = check_payload(estimate, payload_request.limits, repeats, left_on)
    unloaded = [run for run, carried in zip(data, loaded, strict=True) if not carried]
    checks = (*held, *_arm_checks(unloaded, payload_request), *_rounding_checks(rounded))
    return PayloadResult(estimate, checks), repeats


def gear_findings(data: Sequence[RunData], payload_request: PayloadRequest) -> list[str]:
    """Return a finding with the code `RIGID_GEARS` if a payload is estimated as on rigid gears.

    Args:
        data: The runs.
        payload_request: Options of the estimate.
    """
    how = payload_request.how
    if how.robot is not None and how.robot.gear_torque_nm is None and has_stiffness(data[0].robot):
        why = "the model was fitted to the motors: identify it again with this robot file"
    elif gears_bend(data[0].robot, how) and payload_request.time_domain_effects:
        why = f"the model contains {payload_request.time_domain_effects}"
    elif gears_bend(data[0].robot, how) and not data[0].is_periodic:
        why = "the runs are not periodic: record a periodic excitation"
    else:
        return []
    return [
        "The gears are elastic, but the payload was estimated as if they were rigid, because"
        f" {why} ({RIGID_GEARS})."
    ]


def report_payload(
    payload: PayloadResult,
    repeats: Repeats | None,
    path: Path,
    *,
    folder: RunFolder,
    result: Result,
    findings: Sequence[str] = (),
    empty: EmptyFlange | None = None,
) -> IdentifiedPayload:
    """Add an estimated payload to the result of a folder, and write the report.

    Args:
        payload: The payload with its verdict, as `estimate_payload` returns it. A payload read from
            a file is not sufficient: the file lacks the advice of each check, which shows if the
            check concerns the fit.
        repeats: Estimates of each run alone; None without them.
        path: The payload file, which is written.
        folder: The session, or the run that gets the report.
        result: Result of the folder, to which the payload is added.
        findings: Sentences about the runs for the report.
        empty: Evidence that the flange was empty in the runs without payload.

    Raises:
        RecordingError: A file cannot be written.
    """
    register_output(folder, path)
    section = PayloadSection.of(payload, repeats, findings)
    verdict = payload_verdict(payload, empty)
    report = write_result(folder, result.with_sections(payload=section, verdict=verdict))
    fits = all(line.passed for line in payload.checks if line.advice == BAD_FIT)
    return IdentifiedPayload(section, verdict, path, report, fits)


def _refuse_runs_of_model(data: Sequence[RunData], loaded: Sequence[bool], model: Estimate) -> None:
    """Refuse a run with the payload from which the model of the robot was identified.

    The model then contains a part of the payload, or its errors are those of the run; the intervals
    count them as independent.

    Raises:
        ConfigError: There is such a run.
    """
    ids = [run.folder.run_id for run, carried in zip(data, loaded, strict=True) if carried]
    own = [run_id for run_id in ids if run_id in model.run_ids]
    if own:
        raise ConfigError(
            f"the model was identified from {', '.join(own)}, a run with the payload: identify the"
            " robot from other runs, or give runs without payload and no model",
            code="RID-PAYLOAD-RUNS",
        )


def _arm_checks(
    empty: Sequence[RunData], payload_request: PayloadRequest
) -> tuple[PayloadCheck, ...]:
    """Check if the torques of the runs without payload are physically plausible.

    A wrong unit or sign of all torques changes the payload too, but the residual does not show it.
    """
    if not empty:
        return ()
    how = EstimationJob(EstimationOptions(band_hz=payload_request.band_hz))
    driving, weight = find_impossibilities(signals_for_diagnosis(empty, how, empty[0].robot))
    text = f"joints with negative friction power ({', '.join(driving)})"
    found = [PayloadCheck(text, len(driving), "≤", 0.0, "", BAD_FIT)] if driving else []
    if weight is not None:
        found += weight_checks(weight)
    return tuple(found)


def weight_checks(weight: ArmWeight) -> tuple[PayloadCheck, ...]:
    """Compare the nearer end of the interval of the arm's weight with its plausible range.

    There is no check if the arm has no CAD weight, or if the interval is wider than the range.
    """
    if not weight.is_drawn or not weight.is_known:
        return ()
    (low, high), sure = weight.plausible, 2.0 * weight.sigma
    light = weight.share < 1.0
    value, limit = (weight.share + sure, low) if light else (weight.share - sure, high)
    text = (
        "weight of the arm, computed from its torques without payload, relative to its CAD weight"
        f" ({'upper' if light else 'lower'} end of the 2σ interval)"
    )
    return (PayloadCheck(text, value, "≥" if light else "≤", limit, "", HEAVY),)


def _rounding_checks(rounded: RoundedPositions | None) -> tuple[PayloadCheck, ...]:
    """Compare the rounding errors of the positions with the motion; no check without rounding."""
    if rounded is None:
        return ()
    text = (
        "power of the rounding errors' acceleration relative to that of the motion, up to"
        f" {rounded.band_hz:g} Hz"
    )
    share, limit = 100.0 * rounded.noise_share, 100.0 * NOISE_SHARE_LIMIT
    return (PayloadCheck(text, share, "≤", limit, "%", ROUNDED),)


def _comparison_runs(
    data: Sequence[RunData], loaded: Sequence[bool], how: PayloadOptions
) -> list[int]:
    """Return the indices of runs without payload that were not used to identify the model."""
    model_runs = () if how.robot is None else how.robot.run_ids
    pairs = enumerate(zip(data, loaded, strict=True))
    return [i for i, (run, carried) in pairs if not carried and run.folder.run_id not in model_runs]
