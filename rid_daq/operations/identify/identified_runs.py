"""`identify_runs`: estimate a robot from runs; write a model file and a report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from acquisition.runs.catalogue import find_runs
from identification.calibration.drive_gains import DriveGains
from identification.elasticity.gear_torque import with_rigid_gears
from identification.estimation.file import write_estimate
from identification.regression.fit_grade import Grade
from identification.validation.period_comparison import compare_period
from rid_daq.operations.estimation.run_estimation import (
    with_bodies,
)
from rid_daq.operations.estimation.wiring_findings import OTHER_ROBOT
from rid_daq.operations.identify.identified_robot import IdentifiedRobot, identify_robot
from rid_daq.operations.identify.identify import IdentifyRequest
from rid_daq.operations.operation import Context
from rid_daq.report.model_file import ModelFile
from rid_daq.report.result import NOTHING_JUDGED, Result
from rid_daq.report.sections.average import AverageSection
from rid_daq.report.sections.curves import CurvesSection
from rid_daq.report.sections.estimate import EstimateSection
from rid_daq.report.sections.runs import ClockSection
from rid_daq.report.sections.verdict import VerdictSection
from rid_daq.report_page.write import write_result
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output, register_output
from rid_daq.runs.run_data import RunData, clock_sections, result_of, show_defects
from rid_daq.terminal.choices import MODEL
from rid_daq.terminal.context import working

BAD_FIT = "Failed: the model does not explain this run"
MISTAKEN = "Failed: a file of this run is probably wrong"


@dataclass(frozen=True)
class IdentifiedRuns:
    """A model that was identified and written.

    Attributes:
        model: Path of the model file.
        result: Result of the first run.
        notes: Defects of the runs' data.
        gains: Drive gains; None if no load mass was given.
        plate_unused: True if periodic runs have a force plate that the model does not use.
        clocks: Repeated, missing and jittered rows of each run, and the source of its times.
        objections: Reasons to reject the model, one sentence each; empty if there are none.
    """

    model: Path
    result: Result
    report: Path
    notes: list[str]
    gains: DriveGains | None
    plate_unused: bool
    clocks: list[ClockSection]
    objections: tuple[str, ...]

    @property
    def section(self) -> EstimateSection:
        """Section of the result that contains the estimate."""
        assert self.result.estimate is not None
        return self.result.estimate

    @property
    def bad_joints(self) -> tuple[str, ...]:
        """Joints whose torque the model does not explain."""
        return tuple(axis.joint for axis in self.section.axes if axis.grade is Grade.BAD)


def identify_runs(request: IdentifyRequest, context: Context) -> IdentifiedRuns:
    """Estimate a robot from runs; write the model file and the first run's report.

    Args:
        request: The request.
        context: Shows progress, and defects of the runs' data.

    Raises:
        ConfigError: The runs are of different robots or kinds, or the options exclude one another.
        DataQualityError, EstimationError: The data do not determine the parameters.
        RecordingError, LockedError: A run cannot be read, or a file cannot be written.
    """
    request.refuse_contradictions()
    refuse_output(request.output, request.overwrite, made_file.MODEL)
    found = find_runs(request.runs, list(request.names))
    with working(context, "Reading the runs"):
        data = tuple(RunData.load(folder, unfinished=request.unfinished) for folder in found)
    notes = show_defects(context, data)
    robot = identify_robot(request, data, context)
    first, section, objections = data[0], robot.section, robot.estimate.objections
    output = request.output or first.folder.file(MODEL)
    write_estimate(output, robot.estimate)
    register_output(first.folder, output)
    before = result_of(first, notes)
    result = before.with_model_sections(
        ModelFile.of(output), estimate=section, plate=robot.plate, comparison=robot.comparison
    )
    verdict = _fit_verdict(before.verdict, robot)
    result = result if verdict is None else result.with_sections(verdict=verdict)
    if first.is_periodic:
        average = robot.averages[0]
        carrying = with_bodies(robot.estimate, robot.bodies)
        period = compare_period(carrying, with_rigid_gears(average, carrying))
        result = result.with_sections(
            average=AverageSection.of(average, first.robot),
            curves=CurvesSection.of_period(carrying, period, average.periods_kept),
        )
    report = write_result(first.folder, result)
    unused = robot.plate is None and first.is_periodic and all(item.has_plate for item in data)
    return IdentifiedRuns(
        output, result, report, notes, robot.gains, unused, clock_sections(data), objections
    )


def _fit_verdict(before: VerdictSection, robot: IdentifiedRobot) -> VerdictSection | None:
    """Return a failed verdict if there are objections to the model.

    Otherwise return `NOTHING_JUDGED` if the earlier verdict was about a bad fit or a mistake, and
    None if the earlier verdict remains.
    """
    why = list(robot.estimate.objections)
    if not why:
        return NOTHING_JUDGED if before.headline in (BAD_FIT, MISTAKEN) else None
    section = robot.section
    if section.mistakes == () and any(axis.grade is Grade.BAD for axis in section.axes):
        why.append(OTHER_ROBOT)
    headline = MISTAKEN if robot.estimate.contradictions else BAD_FIT
    return VerdictSection.failed(headline, " ".join(why))
