"""Estimate from runs: periodic runs at their harmonics, other runs in the time domain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from acquisition.processing.periods import PeriodAverage
from acquisition.processing.smoothing import SmoothedSignals
from acquisition.processing.torque_channel import TorqueChannel
from config.cell.plate import PlateDescription
from config.errors import ConfigError, EstimationError
from config.ranges import Ranged
from config.robot.robot import RobotDescription
from dynamics.model.cad import cad_prior
from identification.accuracy.plate_benefit import Improvement, improvement
from identification.calibration.drive_gains import DriveGains, drive_gains
from identification.calibration.plate_mistake import PlateMistake
from identification.calibration.plate_search import (
    CELL_NAMES,
    MAP_NAMES,
    WRENCH_MAP_NAMES,
    find_plate_mistake,
)
from identification.calibration.torque_scale import TorqueConsistency, torque_consistency
from identification.cross_checks.agreement import CrossCheck, cross_checks
from identification.elasticity.elastic_fit import fit_elastic, rigid_averages
from identification.equations.bus_delay import split_implausible_channel
from identification.equations.deconvolution import smoothed_recording
from identification.equations.segments import period_signals, unfiltered_period_signals
from identification.equations.time_domain import time_runs
from identification.equations.warming import Warming
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_periods import PLATE_LATE, unsolved_equations
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.model.known_loads import Bodies, known_values
from identification.model.still_joints import JERK_SHARE, refuse_unmoved_joints, still_joints
from identification.validation.channel_choice import KINDS
from identification.validation.model_choice import (
    DELAYS_ALONE,
    ModelChoice,
    Watch,
    choose_model,
)
from identification.validation.period_delays import choose_period_delays
from rid_daq.runs.repeated_imports import refuse_repeated_imports
from rid_daq.runs.run_data import RunData

PLATE_MISTAKEN: Final = "RID-PLATE-MISTAKEN"


@dataclass(frozen=True, eq=False)
class EstimationJob(Ranged):
    """Options of an estimate from runs.

    Attributes:
        options: Terms of the model, band and weights of the equations.
        cad_prior: True if the CAD data are prior knowledge.
        loaded: Ids of the runs with an unknown payload.
        bodies: Known bodies that the robot carried, by the ids of the runs.
        has_rounded_positions: True if positions are rounded coarsely; a filter of the torques
            cannot be distinguished from that.
    """

    options: EstimationOptions = field(default_factory=EstimationOptions)
    cad_prior: bool = False
    loaded: tuple[str, ...] = ()
    bodies: Mapping[str, Bodies] = field(default_factory=dict)
    has_rounded_positions: bool = False

    def bodies_of(self, data: Sequence[RunData]) -> tuple[Bodies, ...] | None:
        """Return the known bodies of each run; None if no run has any."""
        if not self.bodies:
            return None
        return tuple(self.bodies.get(item.folder.run_id, {}) for item in data)

    def with_rotors_of(self, estimate: Estimate) -> EstimationJob:
        """Return this job with the base parameters of its estimate, for estimates to compare."""
        rotors = estimate.options.separate_rotors
        model = replace(self.options.model, separate_rotors=rotors)
        return replace(self, options=replace(self.options, model=model))

    def without_bodies(self, data: Sequence[RunData]) -> tuple[RunData, ...]:
        """Return the runs without known bodies."""
        return tuple(item for item in data if item.folder.run_id not in self.bodies)

    def empty_runs(self, data: Sequence[RunData]) -> tuple[RunData, ...]:
        """Return the runs without known bodies and without an unknown payload."""
        bare = self.without_bodies(data)
        return tuple(item for item in bare if item.folder.run_id not in self.loaded)


@dataclass(frozen=True, eq=False)
class EstimatedRobot:
    """An estimate, with the results that were computed together with it.

    Attributes:
        estimate: The estimate.
        averages: Mean periods of the runs, in time; empty if the runs are not periodic.
        improvement: Improvement by the force plate, for a combined model.
        consistency: Agreement of the torque constants with the force plate, for a combined model.
        plate_mistake: Probable mistake in the description of the force plate.
    """

    estimate: Estimate
    averages: tuple[PeriodAverage, ...] = ()
    improvement: Improvement | None = None
    consistency: TorqueConsistency | None = None
    plate_mistake: PlateMistake | None = None


def estimate_runs(
    data: Sequence[RunData],
    how: EstimationJob | None = None,
    *,
    robot: RobotDescription | None = None,
    chosen: ModelChoice | None = None,
    smoothed: Sequence[SmoothedSignals] = (),
) -> EstimatedRobot:
    """Estimate a robot from its runs; either all runs must be periodic, or none.

    Args:
        robot: Robot with the friction terms from `compare_friction`; the runs' own robot if None.
        chosen: Result of `compare_friction`, whose torque channel is applied; for runs that are not
            periodic, the warming of the joints is applied too.
        smoothed: Result of `smoothed_runs`, if it is known.

    Raises:
        ConfigError: The runs are of different robots, or only some are periodic; or the robot file
            has no CAD data.
        DataQualityError, EstimationError: The data do not determine the parameters.
        RecordingError: A recording cannot be read.
    """
    how = how or EstimationJob()
    robot = robot or require_one_robot(data)
    channel = None if chosen is None or not chosen.channel.changes else chosen.channel
    warming = None if chosen is None else chosen.warming
    payload = [item.folder.run_id in how.loaded for item in data]
    run_ids = tuple(item.folder.run_id for item in data)
    cell_name = data[0].tally.head.cell_name
    options = how.options
    if how.cad_prior:
        prior = cad_prior(options.model.build(robot), robot)
        options = replace(options, prior=prior)
    bodies = how.bodies_of(data)
    if not data[0].is_periodic:
        estimate = fit_smoothed(
            robot,
            with_joint_warming(signals_of(data, how, channel, smoothed), robot, warming),
            options,
            payload=payload,
            bodies=bodies,
        ).estimate(cell_name=cell_name, run_ids=run_ids)
        return EstimatedRobot(replace(estimate, channel=channel, warming=warming))
    averages = period_averages(data, channel)
    plate = None if options.model.kind == "internal" else data[0].plate
    names = CELL_NAMES
    if data[0].import_report is not None:
        names = MAP_NAMES if isinstance(plate, PlateDescription) else WRENCH_MAP_NAMES
    try:
        fitted = fit_elastic(robot, averages, options, payload=payload, bodies=bodies)
    except EstimationError as error:
        if plate is None or error.refusal != PLATE_LATE or bodies is not None:
            raise
        equations, model, base = unsolved_equations(robot, averages, options)
        still = [0.0] * len(averages)
        mistake = find_plate_mistake(averages, equations, still, plate, robot, model, base, names)
        if mistake is None:
            raise
        raise EstimationError(mistake.sentence, code=PLATE_MISTAKEN) from error
    estimate = replace(fitted.estimate(cell_name, run_ids), channel=channel)
    if options.model.kind == "internal":
        return EstimatedRobot(estimate, averages)
    mistake = None
    if plate is not None and bodies is None:
        delays_s = fitted.problem.delays_s.tolist()
        mistake = find_plate_mistake(
            averages, fitted.equations, delays_s, plate, robot, fitted.model, fitted.base, names
        )
    if options.model.kind == "external":
        return EstimatedRobot(estimate, averages, plate_mistake=mistake)
    improved, agreed = improvement(fitted), torque_consistency(fitted)
    return EstimatedRobot(estimate, averages, improved, agreed, mistake)


def add_mass_uncertainty(
    estimate: Estimate, data: Sequence[RunData], how: EstimationJob
) -> Estimate:
    """Return an estimate whose intervals contain the uncertainty of the known bodies' masses.

    For each weighed body, the estimate is repeated with a mass that is one standard deviation
    larger.
    """
    weighed = {
        name: body
        for bodies in how.bodies.values()
        for name, body in bodies.items()
        if body.mass_sigma_kg > 0.0
    }
    how = how.with_rotors_of(estimate)
    more = np.zeros_like(estimate.covariance_residual)
    for name, body in weighed.items():
        heavier = body.model_copy(update={"mass_kg": body.mass_kg + body.mass_sigma_kg})
        changed = {
            run: {each: heavier if each == name else own for each, own in bodies.items()}
            for run, bodies in how.bodies.items()
        }
        step = estimate_runs(data, replace(how, bodies=changed)).estimate.values - estimate.values
        more += np.outer(step, step)
    return estimate.add_covariance(more)


def with_bodies(estimate: Estimate, bodies: Bodies) -> Estimate:
    """Return an estimate of the robot with known bodies on its links."""
    (known,) = known_values(estimate.model, estimate.base, [bodies])
    return replace(estimate, values=estimate.values + known)


def compare_friction(
    data: Sequence[RunData],
    how: EstimationJob,
    watch: Watch | None = None,
    smoothed: Sequence[SmoothedSignals] = (),
) -> ModelChoice:
    """Choose the friction terms of each joint by cross-validation with these runs.

    `smoothed` is the result of `smoothed_runs`, if it is known.

    Raises:
        ConfigError: The runs are of different robots or kinds, or carry a payload or known bodies.
        DataQualityError, EstimationError: The data do not determine the parameters.
        RecordingError: A recording cannot be read.
    """
    robot = require_one_robot(data)
    if how.loaded or how.bodies:
        raise ConfigError(
            "--choose needs runs without payload: leave --loaded and --loads out with --choose",
            code="RID-OPTION-EXCLUSIVE",
        )
    signals = signals_of(data, how, smoothed=smoothed)
    motions = [(run.position, run.velocity) for run in signals]
    model, speed = how.options.model.build(robot), how.options.standstill_rad_s
    still = still_joints(model, motions, speed, JERK_SHARE)
    refuse_unmoved_joints(still, "friction terms cannot be chosen (--choose)")
    if not all(item.clock is None or item.clock.is_known for item in data):
        return choose_model(robot, signals, how.options, kinds=("none",), watch=watch)
    if data[0].is_periodic:
        return _choose_by_periods(robot, data, how, watch)
    kinds = DELAYS_ALONE if how.has_rounded_positions else tuple(KINDS)
    chosen = choose_model(robot, signals, how.options, kinds=kinds, watch=watch)
    channel, refused = split_implausible_channel(chosen.channel, signals[0].sample_period_s)
    if refused:
        chosen = choose_model(robot, signals, how.options, kinds=("none",), watch=watch)
        return replace(chosen, refused=refused)
    return replace(chosen, channel=channel)


def _choose_by_periods(
    robot: RobotDescription, data: Sequence[RunData], how: EstimationJob, watch: Watch | None
) -> ModelChoice:
    """Choose friction terms and torque delays with mean periods; no filters are searched for."""
    averages = period_averages(data)
    signals = signals_of(data, how)
    chosen = choose_model(robot, signals, how.options, kinds=DELAYS_ALONE, watch=watch)
    channel = choose_period_delays(chosen.robot(robot), averages, how.options)
    channel, refused = split_implausible_channel(channel, averages[0].sample_period_s)
    if not refused:
        return replace(chosen, channel=channel)
    chosen = choose_model(robot, signals, how.options, kinds=("none",), watch=watch)
    return replace(chosen, refused=refused)


def cross_check_estimate(
    estimate: Estimate, data: Sequence[RunData], how: EstimationJob
) -> Iterator[CrossCheck]:
    """Yield comparisons of an estimate with other methods, from its runs without known bodies.

    Raises:
        ConfigError: All runs carried known bodies.
        DataQualityError, EstimationError: The data cannot be used for the comparison.
    """
    data = how.without_bodies(data)
    if not data:
        raise ConfigError(
            "--cross-check uses the runs without known bodies, but every run carried some: add a"
            " run without bodies, or leave --cross-check out",
            code="RID-PAYLOAD-RUNS",
        )
    loaded = [item.folder.run_id in how.loaded for item in data]
    signals = _signals_of_estimate(estimate, data, how)
    yield from cross_checks(estimate, time_runs(estimate.model, signals, loaded))


def estimate_drive_gains(
    estimate: Estimate,
    data: Sequence[RunData],
    how: EstimationJob,
    mass_kg: float,
    mass_sigma_kg: float,
) -> DriveGains:
    """Estimate drive gains from the runs of an estimate; some runs carry a load of known mass.

    Raises:
        ConfigError, DataQualityError, EstimationError: The runs or the model do not determine the
            gains, or a gain is implausible.
    """
    loaded = [item.folder.run_id in how.loaded for item in data]
    runs = time_runs(estimate.model, _signals_of_estimate(estimate, data, how), loaded)
    gains = drive_gains(estimate, runs, mass_kg, mass_sigma_kg)
    gains.require_plausible(mass_kg)
    return gains


def _signals_of_estimate(
    estimate: Estimate, data: Sequence[RunData], how: EstimationJob
) -> list[SmoothedSignals]:
    """Return the signals from which an estimate was computed; mean periods are unfiltered."""
    if data[0].is_periodic:
        averages = period_averages(data, estimate.channel)
        payload = [item.folder.run_id in how.loaded for item in data]
        rigid = rigid_averages(estimate, averages, payload=payload, bodies=how.bodies_of(data))
        return [unfiltered_period_signals(average, how.options.band_hz) for average in rigid]
    return with_joint_warming(
        signals_of(data, how, estimate.channel), estimate.robot, estimate.warming
    )


def with_joint_warming(
    signals: list[SmoothedSignals], robot: RobotDescription, warming: Warming | None
) -> list[SmoothedSignals]:
    """Return the signals with joint temperatures computed from friction, if the robot warms up."""
    return (
        signals if warming is None else [warming.with_temperatures(robot, each) for each in signals]
    )


def signals_of(
    data: Sequence[RunData],
    how: EstimationJob,
    channel: TorqueChannel | None = None,
    smoothed: Sequence[SmoothedSignals] = (),
) -> list[SmoothedSignals]:
    """Return each run as low-passed signals in time; for a periodic run, those of its mean period.

    A known torque channel is applied to the model's torque; for periodic runs, its delays are
    removed from the measured torque instead. `smoothed` is the result of `smoothed_runs`, if it is
    known.
    """
    if data[0].is_periodic:
        averages = period_averages(data, channel)
        return [period_signals(average, how.options.band_hz) for average in averages]
    return [replace(each, channel=channel) for each in smoothed or smoothed_runs(data, how)]


def smoothed_runs(data: Sequence[RunData], how: EstimationJob) -> list[SmoothedSignals]:
    """Return runs that are not periodic as low-passed signals; no signals of periodic runs."""
    if data[0].is_periodic:
        return []
    return [smoothed_recording(item.recording, how.options.band_hz) for item in data]


def period_averages(
    data: Sequence[RunData], channel: TorqueChannel | None = None
) -> tuple[PeriodAverage, ...]:
    """Return the mean periods of periodic runs; known delays of the torques are removed."""
    averages = (item.average for item in data)
    return tuple(each if channel is None else channel.undelayed_period(each) for each in averages)


def require_one_robot(data: Sequence[RunData]) -> RobotDescription:
    """Return the robot of some runs; either all runs must be periodic, or none.

    Raises:
        ConfigError: The runs differ in robot or kind, or two are the same recording.
        RecordingError: A recording cannot be read.
    """
    robot = data[0].robot
    for other in data[1:]:
        if other.robot != robot:
            raise ConfigError(
                f"run {other.folder.run_id} is of robot {other.robot.name}, but run"
                f" {data[0].folder.run_id} is of {robot.name} (or of another description of that"
                " robot): identify each run separately",
                code="RID-ROBOT-OTHER",
            )
    kinds = {item.is_periodic for item in data}
    if len(kinds) > 1:
        names = ", ".join(item.folder.run_id for item in data if not item.is_periodic)
        raise ConfigError(
            f"some runs are periodic, others ({names}) are not: identify each kind separately",
            code="RID-RUN-KINDS-MIXED",
        )
    refuse_repeated_imports(data)
    return robot
