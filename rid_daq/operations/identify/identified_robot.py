"""`identify_robot`: estimate a robot from runs, and check the estimate."""

from __future__ import annotations

from dataclasses import dataclass, replace

from acquisition.processing.periods import PeriodAverage
from acquisition.processing.smoothing import SmoothedSignals
from acquisition.runs.catalogue import find_run
from config.errors import ConfigError, EstimationError
from identification.calibration.base_reaction import weight_words
from identification.calibration.drive_gains import DriveGains
from identification.cross_checks.agreement import CrossCheck, CrossMethod
from identification.estimation.estimate import Estimate
from identification.estimation.options import EstimationOptions
from identification.model.known_loads import Bodies, load_findings
from identification.validation.model_choice import STEPS, ModelChoice
from identification.wiring.held_out import held_out_share
from rid_daq.operations.estimation.estimate_findings import (
    contradictions_of,
    contradictions_of_torque_meaning,
    estimate_findings,
    examine_consistency,
)
from rid_daq.operations.estimation.missing_effects import MissingEffects, find_missing_effects
from rid_daq.operations.estimation.rounded_runs import (
    add_rounding_uncertainty,
    add_torque_rounding_uncertainty,
    find_rounded_positions,
)
from rid_daq.operations.estimation.run_estimation import (
    EstimationJob,
    add_mass_uncertainty,
    compare_friction,
    cross_check_estimate,
    estimate_drive_gains,
    estimate_runs,
    require_one_robot,
    smoothed_runs,
)
from rid_daq.operations.estimation.wiring_diagnosis import (
    diagnose_wiring,
    signals_for_diagnosis,
)
from rid_daq.operations.estimation.wiring_findings import WiringDiagnosis
from rid_daq.operations.identify.identify import IdentifyRequest
from rid_daq.operations.known_bodies import known_bodies
from rid_daq.operations.operation import Context
from rid_daq.report.sections.comparison import ComparisonSection
from rid_daq.report.sections.estimate import EstimateChecks, EstimateSection
from rid_daq.report.sections.plate import PlateSection
from rid_daq.runs.measured_torques import require_torques
from rid_daq.runs.repeated_imports import sample_row_hashes
from rid_daq.runs.run_data import RunData
from rid_daq.runs.stated_gears import with_stated_gears
from rid_daq.terminal.context import working


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


def identify_robot(
    request: IdentifyRequest, data: tuple[RunData, ...], context: Context
) -> IdentifiedRobot:
    """Estimate a robot from runs that were read; nothing is written.

    Args:
        request: Options of the estimate; its `names` and `output` are not used.
        data: The runs.
        context: Shows progress.

    Raises:
        ConfigError: The runs are of different robots or kinds, or the options exclude one another.
        DataQualityError, EstimationError: The data do not determine the parameters.
        RecordingError: A recording cannot be read.
    """
    request.refuse_contradictions()
    imported_row_hashes = sample_row_hashes(data)
    data = with_stated_gears(data, request.gears)
    require_one_robot(data)
    how = _estimation_job(request, data)
    rounded = find_rounded_positions(data, how.options.band_hz)
    if rounded is not None:
        options = replace(how.options, band_hz=rounded.band_hz)
        how = replace(how, options=options, has_rounded_positions=True)
    if how.options.model.kind != "external":
        require_torques(data)
    with working(context, "Filtering the recordings"):
        smoothed = smoothed_runs(data, how)
    comparison = _choose_model(data, how, context, smoothed) if request.choose else None
    robot = None if comparison is None else comparison.robot(data[0].robot)
    try:
        with working(context, "Estimating the parameters"):
            identified = estimate_runs(data, how, robot=robot, chosen=comparison, smoothed=smoothed)
    except EstimationError as error:
        if error.refusal != "RID-STIFFNESS-UNSETTLED" or not request.diagnose:
            raise
        raise _with_mistakes(error, data, how) from None
    estimate = replace(identified.estimate, imported_row_hashes=imported_row_hashes)
    if rounded is not None:
        estimate, rounded = add_rounding_uncertainty(
            estimate, rounded, data, how, robot, comparison
        )
        rounded = rounded if rounded.is_material else None
    estimate, of_torques = add_torque_rounding_uncertainty(estimate, data, how, robot, comparison)
    if how.bodies:
        estimate = add_mass_uncertainty(estimate, data, how)
    estimate, wiring = _diagnose(estimate, data, how, smoothed, context, search=request.diagnose)
    smoothed.clear()  # its memory is needed below
    gains = None
    if request.load_mass_kg is not None:
        gains = estimate_drive_gains(estimate, data, how, *request.load_mass_kg)
    weight, plate = weight_words(estimate), None
    if estimate.plate is not None:
        plate = PlateSection.of(
            estimate.plate,
            weight,
            identified.improvement,
            identified.consistency,
            identified.plate_mistake,
        )
    consistency, consistency_words = examine_consistency(estimate)
    missing = MissingEffects()
    if request.diagnose:
        with working(context, "Searching for missing effects"):
            missing = find_missing_effects(estimate, data, how, comparison, wiring)
    estimate = replace(estimate, contradictions=contradictions_of(wiring, missing, plate))
    run_ids = [item.folder.run_id for item in data]
    findings = [
        *wiring.sentences,
        *wiring.late_sentences,
        *estimate_findings(estimate, data, weight),
        consistency_words,
        *([] if rounded is None else [rounded.sentence]),
        *of_torques,
        *load_findings(how.bodies, run_ids, bool(how.empty_runs(data))),
        *contradictions_of_torque_meaning(data, wiring),
        *([] if comparison is None else comparison.refused.findings(comparison.joint_names)),
        *([] if gains is None else [f"{sentence}." for sentence in gains.sentences()]),
        *missing.findings,
        *missing.payloads,
        *(_cross_check(data, how, estimate, context) if request.cross_check else []),
    ]
    checks = EstimateChecks(
        findings=tuple(findings),
        mistakes=wiring.mistakes,
        driving=wiring.driving,
        late_torques=missing.late,
        clipped_torques=missing.clipped,
        arm_weight=wiring.weight,
        moved_masses=wiring.masses,
        unconfirmed=wiring.unconfirmed,
        rounded=rounded,
        consistency=consistency,
    )
    return IdentifiedRobot(
        estimate,
        EstimateSection.of(estimate, checks=checks),
        identified.averages,
        wiring,
        plate,
        None if comparison is None else ComparisonSection.of(comparison),
        gains,
        how.bodies.get(run_ids[0], {}),
    )


def _estimation_job(request: IdentifyRequest, data: tuple[RunData, ...]) -> EstimationJob:
    """Return the estimation options of a request, with the payloads and bodies of its runs."""
    asked = request.how.options
    model = asked.model.options()
    model = replace(model, payload=model.payload or bool(request.loaded))
    options = EstimationOptions(model, asked.weighting, None, asked.band_hz, asked.standstill_rad_s)
    loaded, bodies = _loaded_run_ids(request, data), known_bodies(request.loads, request.runs, data)
    return EstimationJob(options, request.how.cad_prior, loaded, bodies)


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


def _diagnose(
    estimate: Estimate,
    data: tuple[RunData, ...],
    how: EstimationJob,
    smoothed: list[SmoothedSignals],
    context: Context,
    *,
    search: bool,
) -> tuple[Estimate, WiringDiagnosis]:
    """Return the estimate and the diagnosis; with `search`, also held-out error and mistakes.

    Runs that all carry a payload or bodies, and a model of the force plate alone, are not examined.
    """
    empty = how.empty_runs(data)
    if how.options.model.kind == "external" or not empty:
        return estimate, WiringDiagnosis()
    signals = signals_for_diagnosis(data, how, data[0].robot, smoothed, estimate.channel)
    if not search:
        return estimate, diagnose_wiring(signals, empty[0], estimate, search=False)
    with context.progress("Searching for mistakes", None, "steps") as shown:
        shown.update(0.0, "next: wiring, units and files")
        wiring = diagnose_wiring(signals, empty[0], estimate)
        shown.update(1.0, "next: error on held-out parts")
        estimate = replace(estimate, held_out_share=held_out_share(signals))
        shown.update(2.0, "done")
    return estimate, wiring


def _with_mistakes(
    error: EstimationError, data: tuple[RunData, ...], how: EstimationJob
) -> EstimationError:
    """Return an error of a fit to elastic gears, with the mistakes that can be its cause."""
    empty = how.empty_runs(data)
    if not empty:
        return error
    signals = signals_for_diagnosis(data, how, data[0].robot)
    mistakes = diagnose_wiring(signals, empty[0]).mistakes or ()
    sentences = " ".join(mistake.sentence for mistake in mistakes)
    return EstimationError(f"{error}. {sentences}".removesuffix(". "), code=error.refusal)


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
