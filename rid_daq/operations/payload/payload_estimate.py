"""From run folders to a payload with its verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from acquisition.processing.periods import PeriodAverage
from acquisition.runs.folder import RunFolder
from identification.choices import BAND_HZ, STANDSTILL_RAD_S, PayloadLimits
from identification.equations.deconvolution import smoothed_recording
from identification.estimation.options import EstimationOptions
from identification.payload.file import write_payload
from identification.payload.measured_runs import MeasuredRuns
from identification.payload.periodic_runs import PeriodicRuns
from identification.payload.procedures import PayloadOptions, identify_payload, left_on_flange
from identification.payload.smoothed_runs import SmoothedRuns
from identification.payload.verdict import (
    BAD_FIT,
    HEAVY,
    PayloadCheck,
    PayloadResult,
    Repeats,
    checks,
    repeated,
)
from identification.wiring.search import impossibilities
from rid_daq.operations.identify.run_estimation import EstimationJob, one_robot
from rid_daq.operations.identify.wiring_diagnosis import wired_signals
from rid_daq.operations.payload.shared import IdentifiedPayload
from rid_daq.report.result import Result
from rid_daq.report.sections.payload import EmptyFlange, PayloadSection, payload_verdict
from rid_daq.report_page.write import write_result
from rid_daq.runs.flange import compared
from rid_daq.runs.run_data import RunData, note_output
from rid_daq.terminal.choices import PAYLOAD


@dataclass(frozen=True)
class PayloadRequest:
    """What a person may choose.

    Attributes:
        how: The procedure, the model's terms, what is known.
        limits: How sure the payload must be.
        band_hz, standstill_rad_s: Highest frequency and lowest speed used.
    """

    how: PayloadOptions = field(default_factory=PayloadOptions)
    limits: PayloadLimits = field(default_factory=PayloadLimits)
    band_hz: float = BAND_HZ
    standstill_rad_s: float = STANDSTILL_RAD_S

    @property
    def only_in_time(self) -> str:
        """What the model of the robot says that no mean period shows; empty where there is none.

        Runs are weighed as they were recorded then, and not before they are complete.
        """
        model = self.how.robot
        if model is None:
            return ""
        if model.warming is not None:
            return "how joints warm up"
        narrow = model.channel is not None and model.channel.filters
        return "that torques were low-passed" if narrow else ""


def payload_runs(
    data: Sequence[RunData], loaded: Sequence[bool], payload_request: PayloadRequest
) -> MeasuredRuns:
    """Return runs as the estimators take them: averaged periods, or smoothed recordings.

    What a model of the robot says of late and low-passed torques and of joints that warm up holds
    for them too; the last two hold in time, not in a mean period.

    Raises:
        ConfigError: The runs are of different robots, or of both kinds.
        DataQualityError: A run is too short or too damaged.
    """
    one_robot(data)
    model = payload_request.how.robot
    if data[0].is_periodic and not payload_request.only_in_time:
        return periodic_runs([item.average for item in data], loaded, payload_request)
    signals = [smoothed_recording(item.recording, payload_request.band_hz) for item in data]
    if model is not None and model.channel is not None:
        signals = [replace(each, channel=model.channel) for each in signals]
    if model is not None and model.warming is not None:
        signals = [model.warming.warmed(model.robot, each) for each in signals]
    return SmoothedRuns(tuple(signals), tuple(loaded), payload_request.standstill_rad_s)


def periodic_runs(
    averages: Sequence[PeriodAverage], loaded: Sequence[bool], payload_request: PayloadRequest
) -> PeriodicRuns:
    """Return mean periods as the estimators take them, in time where a model knows the delays."""
    model = payload_request.how.robot
    if model is not None and model.channel is not None:
        averages = [model.channel.undelayed_period(each) for each in averages]
    return PeriodicRuns(
        tuple(averages), tuple(loaded), payload_request.band_hz, payload_request.standstill_rad_s
    )


def payload_from_runs(
    data: Sequence[RunData],
    loaded: Sequence[bool],
    payload_request: PayloadRequest,
    *,
    folder: RunFolder,
    result: Result,
    output: Path | None = None,
    findings: Sequence[str] = (),
    empty: EmptyFlange | None = None,
) -> IdentifiedPayload:
    """Estimate a payload from runs, judge it, and write its file and the report of a folder.

    Args:
        data: The runs.
        loaded: Which of them carried the payload.
        payload_request: How it is estimated.
        folder: The session, or the run that gets the report.
        result: The result of the folder, to which the payload is added.
        output: The file of the payload; in the folder if not set.
        findings: What else a person should know of the runs.
        empty: How it is known that nothing hung on the flange without payload.

    Raises:
        ConfigError: The runs are of different robots, or of both kinds.
        DataQualityError, EstimationError: The data do not show a payload.
        RecordingError: A file cannot be written.
    """
    payload, repeats = judged_payload(data, loaded, payload_request)
    output = output or folder.file(PAYLOAD)
    write_payload(output, payload)
    note_output(folder, output)
    section = PayloadSection.of(payload, repeats, [*compared(data, loaded, payload), *findings])
    verdict = payload_verdict(payload, empty)
    report = write_result(folder, result.updated(payload=section, verdict=verdict))
    return IdentifiedPayload(section, verdict, output, report, payload.fits)


def judged_payload(
    data: Sequence[RunData], loaded: Sequence[bool], payload_request: PayloadRequest
) -> tuple[PayloadResult, Repeats | None]:
    """Return a payload with its verdict, and the same from each run alone; nothing is written.

    Args:
        data: The runs.
        loaded: Which of them carried the payload.
        payload_request: How it is estimated.

    Raises:
        ConfigError: The runs are of different robots, or of both kinds.
        DataQualityError, EstimationError: The data do not show a payload.
    """
    how, robot = payload_request.how, data[0].robot
    runs = payload_runs(data, loaded, payload_request)
    estimate = identify_payload(
        robot,
        runs,
        how,
        cell_name=data[0].tally.head.cell_name,
        run_ids=tuple(item.folder.run_id for item in data),
    )
    repeats = None
    if how.procedure != "difference" and estimate.rank == len(estimate.values):
        repeats = repeated(robot, runs, how)
    left_on = left_on_flange(robot, runs.part(_compared(data, loaded, how)), how)
    held = checks(estimate, payload_request.limits, repeats, left_on)
    unloaded = [run for run, carried in zip(data, loaded, strict=True) if not carried]
    return PayloadResult(estimate, (*held, *_arm_checks(unloaded, payload_request))), repeats


def _arm_checks(
    empty: Sequence[RunData], payload_request: PayloadRequest
) -> tuple[PayloadCheck, ...]:
    """Hold the arm of the runs without payload against what a robot can be.

    A wrong unit or sign of all torques is the payload's as well, and shows in no residual.
    """
    if not empty:
        return ()
    how = EstimationJob(EstimationOptions(band_hz=payload_request.band_hz))
    driving, weight = impossibilities(wired_signals(empty, how, empty[0].robot))
    said = f"joints with driving friction ({', '.join(driving)})"
    found = [PayloadCheck(said, len(driving), "≤", 0.0, "", BAD_FIT)] if driving else []
    if weight is not None and weight.is_drawn:
        (low, high), sure = weight.plausible, 2.0 * weight.sigma
        said = "weight of the arm by its torques without payload, over that of its drawings"
        light = weight.share < 1.0
        value, limit = (weight.share + sure, low) if light else (weight.share - sure, high)
        found.append(PayloadCheck(said, value, "≥" if light else "≤", limit, "", HEAVY))
    return tuple(found)


def _compared(data: Sequence[RunData], loaded: Sequence[bool], how: PayloadOptions) -> list[int]:
    """Return the runs without payload that the model was not identified from."""
    own = () if how.robot is None else how.robot.run_ids
    pairs = enumerate(zip(data, loaded, strict=True))
    return [i for i, (run, carried) in pairs if not carried and run.folder.run_id not in own]
