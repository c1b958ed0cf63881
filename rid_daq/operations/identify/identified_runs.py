"""`identify_runs`: estimate a robot from runs; write a model file and a report."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from acquisition.processing.periods import PeriodAverage
from acquisition.processing.smoothing import SmoothedSignals
from acquisition.runs.catalogue import find_run, find_runs
from config.errors import ConfigError, EstimationError
from identification.calibration.base_reaction import weight_words
from identification.calibration.drive_gains import DriveGains
from identification.consistency.closest_robot import check_consistency
from identification.consistency.consistency_test import ConsistencyTest
from identification.cross_checks.agreement import CrossCheck, CrossMethod
from identification.elasticity.elastic_fit import with_rigid_gears
from identification.estimation.estimate import Estimate
from identification.estimation.file import write_estimate
from identification.estimation.options import EstimationOptions
from identification.model.known_loads import Bodies, load_findings
from identification.regression.fit_grade import Grade
from identification.validation.model_choice import STEPS, ModelChoice
from identification.validation.period_comparison import compare_period
from identification.wiring.held_out import held_out_share
from identification.wiring.torque_origin import torque_contradiction
from rid_daq.operations.identify.identify import IdentifyRequest
from rid_daq.operations.identify.missing_effects import (
    add_rounding_uncertainty,
    estimate_findings,
    find_missing_effects,
    find_rounded_positions,
)
from rid_daq.operations.identify.run_estimation import (
    EstimationJob,
    add_mass_uncertainty,
    compare_friction,
    cross_check_estimate,
    estimate_drive_gains,
    estimate_runs,
    smoothed_runs,
    with_bodies,
)
from rid_daq.operations.identify.wiring_diagnosis import (
    OTHER_ROBOT,
    WiringDiagnosis,
    diagnose_wiring,
    signals_for_diagnosis,
)
from rid_daq.operations.known_bodies import known_bodies
from rid_daq.operations.operation import Context
from rid_daq.report.mistake_entry import ArmWeightEntry, UnconfirmedSection
from rid_daq.report.model_file import ModelFile
from rid_daq.report.result import NOTHING_JUDGED, Result
from rid_daq.report.sections.average import AverageSection
from rid_daq.report.sections.comparison import ComparisonSection
from rid_daq.report.sections.curves import CurvesSection
from rid_daq.report.sections.estimate import EstimateSection, RoundedPositionsEntry
from rid_daq.report.sections.plate import PlateSection
from rid_daq.report.sections.runs import ClockSection
from rid_daq.report.sections.verdict import VerdictSection
from rid_daq.report_page.write import write_result
from rid_daq.runs import made_file
from rid_daq.runs.measured_torques import require_torques
from rid_daq.runs.output_file import refuse_output, register_output
from rid_daq.runs.run_data import RunData, clock_sections, result_of, show_defects
from rid_daq.runs.stated_gears import with_stated_gears
from rid_daq.terminal.choices import MODEL

BAD_FIT = "Failed: the model does not explain this run"
MISTAKEN = "Failed: a file of this run is probably wrong"


@dataclass(frozen=True)
class IdentifiedRobot:
    """Result of an identification, before anything is written.

    Attributes:
        estimate: The estimate.
        section: Section of a report with the estimate.
        averages: Mean periods of periodic runs.
        wiring: Probable mistakes in wiring, units and files.
        plate: Fit of the force plate; None if the model does not use it.
        comparison: Choice of the friction terms; None if they were not chosen.
        gains: Drive gains; None if no load mass was given.
        bodies: Known bodies of the first run.
    """

    estimate: Estimate
    section: EstimateSection
    averages: tuple[PeriodAverage, ...]
    wiring: WiringDiagnosis
    plate: PlateSection | None
    comparison: ComparisonSection | None
    gains: DriveGains | None
    bodies: Bodies


@dataclass(frozen=True)
class IdentifiedRuns:
    """A model that was identified and written.

    Attributes:
        model: Path of the model file.
        result: Result of the first run.
        notes: Defects of the runs' data.
        gains: Drive gains; None if no load mass was given.
        plate_unused: True if the runs have a force plate that the model does not use.
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
        """True if a mistake in files or clock is probable, or the data are impossible."""
        estimate = self.section
        heavy = estimate.arm_weight is not None and not estimate.arm_weight.is_plausible
        wrong = estimate.mistakes or estimate.driving or estimate.late_torques
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
        RecordingError: A run cannot be read, or a file cannot be written.
    """
    request.refuse_contradictions()
    refuse_output(request.output, request.overwrite, made_file.MODEL)
    found = find_runs(request.runs, list(request.names))
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


def identify_robot(
    request: IdentifyRequest, data: tuple[RunData, ...], context: Context
) -> IdentifiedRobot:
    """Estimate a robot from runs that were read; nothing is written.

    Args:
        request: Options of the estimate; its names and files are not used.
        data: The runs.
        context: Shows progress.

    Raises:
        ConfigError: The runs are of different robots or kinds, or the options exclude one another.
        DataQualityError, EstimationError: The data do not determine the parameters.
    """
    request.refuse_contradictions()
    data = with_stated_gears(data, request.gears)
    loaded, bodies = _loaded_run_ids(request, data), known_bodies(request.loads, request.runs, data)
    how = replace(_estimation_job(request), loaded=loaded, bodies=bodies)
    rounded = find_rounded_positions(data, how.options.band_hz)
    if rounded is not None:
        options = replace(how.options, band_hz=rounded.band_hz)
        how = replace(how, options=options, has_rounded_positions=True)
    if how.options.model.kind != "external":
        require_torques(data)
    first, smoothed = data[0], smoothed_runs(data, how)
    comparison = _choose_model(data, how, context, smoothed) if request.choose else None
    robot = None if comparison is None else comparison.robot(first.robot)
    identified = estimate_runs(data, how, robot=robot, chosen=comparison, smoothed=smoothed)
    estimate, wiring = identified.estimate, WiringDiagnosis()
    if rounded is not None:
        estimate, rounded = add_rounding_uncertainty(
            estimate, rounded, data, how, robot, comparison
        )
    if bodies:
        estimate = add_mass_uncertainty(estimate, data, how)
    empty = how.empty_runs(data)
    if how.options.model.kind != "external" and empty:
        signals = signals_for_diagnosis(data, how, first.robot, smoothed)
        wiring = diagnose_wiring(signals, empty[0], estimate, search=request.diagnose)
        if request.diagnose:
            estimate = replace(estimate, held_out_share=held_out_share(signals))
    smoothed.clear()  # its memory is needed below
    gains, plate = None, None
    if request.load_mass_kg is not None:
        gains = estimate_drive_gains(estimate, data, how, *request.load_mass_kg)
    weight = weight_words(estimate)
    if estimate.plate is not None:
        plate = PlateSection.of(
            estimate.plate,
            weight,
            identified.improvement,
            identified.consistency,
            identified.plate_mistake,
        )
    consistency, consistency_words = _check_consistency(estimate)
    findings = [*wiring.sentences, *estimate_findings(estimate, data, weight), consistency_words]
    if rounded is not None and rounded.is_material:
        findings.append(rounded.sentence)
    findings += load_findings(bodies, [item.folder.run_id for item in data], bool(empty))
    findings += _contradictions_of_torque_meaning(data, wiring)
    if comparison is not None:
        findings += comparison.refused.findings(comparison.joint_names)
    findings += [] if gains is None else [f"{sentence}." for sentence in gains.sentences()]
    late: tuple[str, ...] = ()
    if request.diagnose:
        missing, late = find_missing_effects(estimate, data, how, comparison)
        findings += missing
    findings += _cross_check(data, how, estimate, context) if request.cross_check else []
    section = EstimateSection.of(
        estimate,
        findings=findings,
        mistakes=wiring.mistakes,
        consistency=consistency,
        driving=wiring.driving,
        arm_weight=None if wiring.weight is None else ArmWeightEntry.of(wiring.weight),
        unconfirmed=None
        if wiring.unconfirmed is None
        else tuple(
            UnconfirmedSection.of(each, first.robot.joint_names) for each in wiring.unconfirmed
        ),
    )
    if late:
        section = section.model_copy(update={"late_torques": late})
    if rounded is not None and rounded.is_material:
        section = section.model_copy(
            update={
                "rounded_positions": RoundedPositionsEntry.from_attributes(
                    rounded, steps=rounded.step_of_joint
                )
            }
        )
    return IdentifiedRobot(
        estimate,
        section,
        identified.averages,
        wiring,
        plate,
        None if comparison is None else ComparisonSection.of(comparison),
        gains,
        bodies.get(first.folder.run_id, {}),
    )


def _estimation_job(request: IdentifyRequest) -> EstimationJob:
    """Return the estimation options of a request."""
    asked = request.how.options
    model = asked.model.options()
    model = replace(model, payload=model.payload or bool(request.loaded))
    options = EstimationOptions(model, asked.weighting, None, asked.band_hz, asked.standstill_rad_s)
    return EstimationJob(options, request.how.cad_prior)


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


def _loaded_run_ids(request: IdentifyRequest, data: tuple[RunData, ...]) -> tuple[str, ...]:
    """Return the ids of the runs that carried the payload; they must be among the runs used."""
    ids = tuple(find_run(request.runs, name).run_id for name in request.loaded)
    used = {item.folder.run_id for item in data}
    for name, run_id in zip(request.loaded, ids, strict=True):
        if run_id not in used:
            raise ConfigError(
                f"--loaded {name}: this run is not among the runs to identify; add it to RUN...",
                code="RID-PAYLOAD-RUNS",
            )
    if ids and used <= set(ids):
        raise ConfigError(
            "every run carried the payload, so the payload cannot be separated from the last"
            " link: add a run without payload",
            code="RID-PAYLOAD-RUNS",
        )
    return ids


def _choose_model(
    data: tuple[RunData, ...],
    how: EstimationJob,
    context: Context,
    smoothed: list[SmoothedSignals],
) -> ModelChoice:
    with context.progress("Choosing the model", float(STEPS), "steps") as shown:
        return compare_friction(
            data, how, lambda done, _, name: shown.update(float(done), f"next: {name}"), smoothed
        )


def _cross_check(
    data: tuple[RunData, ...], how: EstimationJob, estimate: Estimate, context: Context
) -> list[str]:
    checks: list[CrossCheck] = []
    with context.progress("Cross-checking", float(len(CrossMethod)), "methods") as shown:
        shown.update(0.0, f"next: {next(iter(CrossMethod))}")
        for number, check in enumerate(cross_check_estimate(estimate, data, how), 1):
            checks.append(check)
            shown.update(float(number), check.sentence)
    return [f"{check.sentence}." for check in checks]


def _contradictions_of_torque_meaning(
    data: tuple[RunData, ...], wiring: WiringDiagnosis
) -> list[str]:
    """Return a finding for each run whose torques contradict the meaning in its import map."""
    if wiring.mistakes is None:
        return []
    kinds, findings = [each.kind for each in wiring.mistakes], []
    for item in data:
        if item.import_report is not None:
            stated = item.import_report.torques
            if why := torque_contradiction(stated, item.recording, item.robot, kinds):
                findings.append(f"Run {item.folder.run_id}: {why}")
    return findings


def _check_consistency(estimate: Estimate) -> tuple[ConsistencyTest | None, str]:
    """Return the test of physical consistency, or None if it cannot be made, and a sentence."""
    try:
        test = check_consistency(estimate)
    except EstimationError as error:
        return None, f"The physical consistency of the parameters cannot be tested: {error}."
    if test.is_consistent:
        return test, (
            f"{test.sentence} This test says nothing about the fit: see the residual of each axis."
        )
    return test, (
        f"{test.sentence} The model lacks a term, or a sign, gear ratio or torque constant in the"
        " robot file is wrong."
    )
