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
from rid_daq.operations.estimation.wiring_findings import OTHER_ROBOT, WiringDiagnosis
from rid_daq.operations.identify.identified_robot import identify_robot
from rid_daq.operations.identify.identify import IdentifyRequest
from rid_daq.operations.operation import Context
from rid_daq.report.model_file import ModelFile
from rid_daq.report.result import NOTHING_JUDGED, Result
from rid_daq.report.sections.average import AverageSection
from rid_daq.report.sections.curves import CurvesSection
from rid_daq.report.sections.estimate import EstimateSection
from rid_daq.report.sections.plate import PlateSection
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
    """

    model: Path
    result: Result
    report: Path
    notes: list[str]
    gains: DriveGains | None
    plate_unused: bool
    clocks: list[ClockSection]

    @property
    def section(self) -> EstimateSection:
        """Section of the result that contains the estimate."""
        assert self.result.estimate is not None
        return self.result.estimate

    @property
    def bad_joints(self) -> tuple[str, ...]:
        """Joints whose torque the model does not explain."""
        return tuple(axis.joint for axis in self.section.axes if axis.grade is Grade.BAD)

    @property
    def has_mistakes(self) -> bool:
        """True if a mistake is probable, a value is impossible, or the plate is doubted."""
        estimate = self.section
        heavy = estimate.arm_weight is not None and not estimate.arm_weight.is_plausible
        heavy |= any(not each.is_plausible for each in estimate.moved_masses or ())
        wrong = estimate.mistakes or estimate.driving
        wrong = wrong or estimate.late_torques or estimate.clipped_torques
        return bool(wrong or heavy or self.plate_is_doubted)

    @property
    def plate_is_doubted(self) -> bool:
        """True if the model does not explain the plate's signals, or the plate's entry is wrong."""
        plate = self.result.plate
        return plate is not None and bool(plate.bad_components or plate.mistake)


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
    first, section, plate = data[0], robot.section, robot.plate
    output = request.output or first.folder.file(MODEL)
    write_estimate(output, robot.estimate)
    register_output(first.folder, output)
    before = result_of(first, notes)
    result = before.with_model_sections(
        ModelFile.of(output), estimate=section, plate=plate, comparison=robot.comparison
    )
    verdict = _fit_verdict(before.verdict, section, robot.wiring, plate)
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
    unused = plate is None and first.is_periodic and all(item.has_plate for item in data)
    return IdentifiedRuns(output, result, report, notes, robot.gains, unused, clock_sections(data))


def _fit_verdict(
    before: VerdictSection,
    section: EstimateSection,
    wiring: WiringDiagnosis,
    plate: PlateSection | None,
) -> VerdictSection | None:
    """Return a failed verdict if the fit is bad or a mistake is probable.

    Otherwise return `NOTHING_JUDGED` if the earlier verdict was about a bad fit or a mistake, and
    None if the earlier verdict remains.
    """
    bad = [axis.joint for axis in section.axes if axis.grade is Grade.BAD]
    why = [mistake.sentence for mistake in section.mistakes or ()] + list(wiring.sentences)
    if wrong := (*(section.late_torques or ()), *(section.clipped_torques or ())):
        why.append(f"The recorded torque of {', '.join(wrong)} is wrong: see the findings.")
    if plate is not None and plate.mistake is not None:
        why.append(plate.mistake.sentence)
    components = () if plate is None else plate.bad_components
    if not bad and not why and not components:
        return NOTHING_JUDGED if before.headline in (BAD_FIT, MISTAKEN) else None
    headline = MISTAKEN if why else BAD_FIT
    if components:
        why.append(f"The model does not explain {', '.join(components)} of the force plate.")
    if bad:
        why.append(f"The model does not explain the torque of {', '.join(bad)}.")
        why += [OTHER_ROBOT] if section.mistakes == () else []
    return VerdictSection.failed(headline, " ".join(why))
