"""Compute feedforward files from a model and velocity loops, and refine them by measured errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.motion.limits import verify_limits
from acquisition.motion.motion_file import AnyMotion
from acquisition.runs.catalogue import find_run, find_runs
from acquisition.supervision.commanded import verify_command
from compensation.compensated_motion import compensated_motion, refuse_torque
from compensation.feedforward.file import (
    FeedforwardOrigin,
    RefinementEntry,
    TuningEntry,
    write_feedforward,
)
from compensation.feedforward.motor_reference import motor_reference
from compensation.feedforward.periodic_rows import with_period
from compensation.feedforward.refinement import Refinement, refinement
from compensation.feedforward.repeated_error import RepeatedError, repeated_error
from compensation.feedforward.tuning import tune
from compensation.loops.velocity_loop import VelocityLoop, in_order
from compensation.operating_temperature import at_operating_temperature
from config.errors import ConfigError, DataQualityError
from config.formats.approved_files import sha256_of
from config.load import LoadedCell, load_cell
from identification.elasticity.gear_torque import has_stiffness
from identification.estimation.estimate import Estimate
from rid_daq.operations.cell_files import (
    read_loops_for,
    read_motion_for,
    read_torque_model,
)
from rid_daq.operations.path.compensate import CompensateRequest
from rid_daq.operations.path.model_doubts import model_doubts
from rid_daq.operations.path.refine import RefineRequest
from rid_daq.operations.rigid_gears import rigid_gears_notes
from rid_daq.operations.stated_loads import state_loads
from rid_daq.operations.stated_payload import state_payload
from rid_daq.runs import made_file
from rid_daq.runs.motion_runs import MotionRun, read_motion_run
from rid_daq.runs.origins import cell_argument
from rid_daq.runs.output_file import refuse_output
from rid_daq.runs.run_data import MOTION, data_defects

GROWN: Final = 1.2
STALLED: Final = 0.9


@dataclass(frozen=True)
class CompensatedMotion:
    """A feedforward that was written.

    Attributes:
        rows: Number of rows of the motion.
        largest: Largest correction of the speed, by joint name [rad/s or m/s].
        tuning: Tuning by the reference run; None without one.
        notes: Defects of the reference run's data, the assumed temperature of the joints, and
            reasons to doubt loops and model.
        bent: Largest deflection of each gear of known stiffness that the position reference
            contains, by joint name [rad or m]; empty if no deflection is corrected.
    """

    rows: int
    largest: dict[str, float]
    tuning: TuningEntry | None
    notes: list[str]
    bent: dict[str, float]


@dataclass(frozen=True)
class RefinedFeedforward:
    """Result of one refinement of a feedforward.

    Attributes:
        measured: Path error that repeats in all runs, and its noise.
        found: Correction computed from this error.
        stalled: True if the path error no longer shrinks from refinement to refinement.
        notes: Defects of the runs' data, the assumed temperature of the joints, and reasons to
            doubt loops and model.
        cell: Cell of the runs, as a command's argument.
        motion: Motion file of one of the runs.
    """

    measured: RepeatedError
    found: Refinement
    stalled: bool
    notes: list[str]
    cell: str
    motion: Path

    @property
    def finished(self) -> bool:
        """True if the feedforward stays unchanged: the path error is noise or no longer shrinks."""
        return self.found.finished or self.stalled


def compensate_motion(request: CompensateRequest) -> CompensatedMotion:
    """Compute a motion's feedforward and write it.

    Raises:
        ConfigError: The files do not belong together, or the output file exists already.
        RidDaqError: The reference run cannot be used, or the motion exceeds the limits.
    """
    refuse_output(request.output, request.overwrite, made_file.FEEDFORWARD)
    loaded = load_cell(request.cell)
    motion = read_motion_for(request.motion, loaded)
    given = read_loops_for(request.loop, loaded.robot, loaded.config)
    loops = given.loops
    samples = motion.plan(loaded.robot, loaded.config.cycle_time_s)
    modelled, model_bytes = read_torque_model(
        request.model, loaded.robot, despite_misfit=request.despite_misfit
    )
    stated = (request.model, request.payload, request.load_changes, request.runs)
    loads = state_loads(modelled, *stated)
    samples = loads.planned(samples)
    velocity = samples.whole().velocity
    warm = at_operating_temperature(loads.first.estimate, request.temperature, velocity)
    load = loads.over_time(
        lambda one: at_operating_temperature(one, request.temperature, velocity).estimate
    )
    position = samples.whole().position
    notes = [
        *given.notes,
        *warm.notes,
        *model_doubts(request.model, warm.estimate, position, loaded.config),
    ]
    tuning = None
    if request.reference is not None:
        folder = find_run(request.runs, request.reference)
        driven = read_motion_run(folder, unfinished=request.unfinished)
        _refuse_other_cell(driven, loaded)
        notes = [*data_defects([driven.data]), *notes]
        tuning = _tune_by_run(driven, motion, warm.estimate, loops)
    reference = None
    if request.deflection and has_stiffness(loaded.robot):
        reference = motor_reference(samples, load, loaded.robot)
    elif request.deflection and "deflection" in request.model_fields_set:
        notes.append(
            f"--deflection has no effect: robot {loaded.robot.name} has no stiffness_nm_rad, so the"
            " positions are not corrected"
        )
    elif request.deflection:
        notes += rigid_gears_notes(
            request.model,
            modelled,
            f"robot {loaded.robot.name} of the cell has no stiffness_nm_rad, so their deflection is"
            " not corrected: copy the stiffness of the model's robot into the robot file",
        )
    compensated = compensated_motion(
        samples, load, loops, None if tuning is None else tuning.as_tuning(), reference
    )
    verify_limits(compensated, loaded.robot)
    verify_command(compensated, loaded.config, loaded.robot)
    refuse_torque(motion, compensated, load, loaded.robot)
    origin = FeedforwardOrigin(
        model_sha256=sha256_of(model_bytes),
        loops_sha256=sha256_of(given.content),
        payload=loads.first.origin,
        load_changes=loads.changes,
        temperature=request.temperature or "",
        tuning=tuning,
    )
    deflection = None if reference is None else reference.deflection
    write_feedforward(request.output, motion, compensated, origin, deflection)
    assert compensated.feedforward is not None
    more = np.abs(compensated.feedforward - compensated.velocity).max(axis=0)
    largest = dict(zip(loaded.robot.joint_names, more.tolist(), strict=True))
    bent = {}
    if deflection is not None:
        peaks = zip(loaded.robot.joints, np.abs(deflection).max(axis=0).tolist(), strict=True)
        bent = {joint.name: peak for joint, peak in peaks if joint.stiffness_nm_rad is not None}
    return CompensatedMotion(len(samples), largest, tuning, notes, bent)


def refine_feedforward(request: RefineRequest) -> RefinedFeedforward:
    """Correct a feedforward by the path error that was measured with it, and write the result.

    If the error is noise or no longer shrinks, the feedforward is written unchanged.

    Raises:
        ConfigError: The runs differ in motion or feedforward, or the output file exists already.
        DataQualityError: The path error has grown since the last refinement.
        RidDaqError: A run, the model or the loops cannot be used, or a limit is exceeded.
    """
    refuse_output(request.output, request.overwrite, made_file.FEEDFORWARD)
    folders = find_runs(request.runs, request.run)
    driven = [read_motion_run(folder, unfinished=request.unfinished) for folder in folders]
    first = driven[0]
    _refuse_mixed(driven)
    samples = first.samples()
    modelled, model_bytes = read_torque_model(
        request.model, first.data.robot, despite_misfit=request.despite_misfit
    )
    carrying = state_payload(modelled, request.model, request.payload, request.runs)
    velocity = samples.whole().velocity
    warm = at_operating_temperature(carrying.estimate, request.temperature, velocity)
    estimate = warm.estimate
    names = samples.joint_names
    given = read_loops_for(request.loop, first.data.robot, first.cell)
    loops = in_order(names, estimate.robot.joint_names, given.loops)
    recordings = [one.data.recording for one in driven]
    measured = repeated_error(first.data.robot, samples, recordings)
    origin = FeedforwardOrigin() if first.file is None else first.file.origin
    _refuse_growth(measured, origin)
    found = refinement(samples, measured, estimate, loops, first.cell.position_gain_per_s)
    doubts = model_doubts(request.model, estimate, samples.position, first.cell)
    notes = [*data_defects([one.data for one in driven]), *given.notes, *warm.notes, *doubts]
    notes += _other_sources(
        origin,
        {
            "model": ("model_sha256", sha256_of(model_bytes)),
            "loop file": ("loops_sha256", sha256_of(given.content)),
            "payload": ("payload", carrying.origin),
            "temperature": ("temperature", request.temperature or ""),
        },
    )
    folder = first.data.folder
    refined = RefinedFeedforward(
        measured,
        found,
        _has_stalled(measured, origin),
        notes,
        cell_argument(folder),
        folder.file(MOTION),
    )
    ahead = samples.velocity if samples.feedforward is None else samples.feedforward
    if not refined.finished:
        more = found.correction
        if measured.periodic:
            more = with_period(samples, np.zeros_like(ahead), more)
        origin = _refined_origin(origin, refined, tuple(one.run_id for one in driven)).model_copy(
            update={
                "model_sha256": sha256_of(model_bytes),
                "loops_sha256": sha256_of(given.content),
                "payload": carrying.origin,
                "temperature": request.temperature or "",
            }
        )
        ahead = ahead + more
    following = replace(samples, feedforward=ahead)
    verify_limits(following, first.data.robot)
    verify_command(following, first.cell, first.data.robot)
    bent = None if first.file is None else first.file.bent_rows(len(samples))
    write_feedforward(request.output, first.motion, following, origin, bent)
    return refined


def _tune_by_run(
    run: MotionRun, motion: AnyMotion, estimate: Estimate, loops: Sequence[VelocityLoop]
) -> TuningEntry:
    """Return scale and delay of the feedforward, tuned by a reference run."""
    samples = run.samples()
    ordered = in_order(samples.joint_names, estimate.robot.joint_names, loops)
    measured = repeated_error(run.data.robot, samples, [run.data.recording])
    found = tune(samples, measured, estimate, ordered, run.cell.position_gain_per_s)
    return TuningEntry.of(found, run.run_id, run.motion == motion)


def _other_sources(origin: FeedforwardOrigin, now: dict[str, tuple[str, str]]) -> list[str]:
    """Return a note for each source of a feedforward that is not the one given now.

    Args:
        origin: The sources with which the feedforward was computed.
        now: For each kind of source, its field in `origin` and its present value.
    """
    return [
        f"The feedforward of these runs was computed with another {kind} than the one given now;"
        " if that is not intended, give the same one"
        for kind, (field, value) in now.items()
        if getattr(origin, field) and getattr(origin, field) != value
    ]


def _refined_origin(
    origin: FeedforwardOrigin, refined: RefinedFeedforward, runs: tuple[str, ...]
) -> FeedforwardOrigin:
    measured, found = refined.measured, refined.found
    entry = RefinementEntry(
        runs=runs,
        rms=tuple(measured.rms.tolist()),
        over_noise=tuple(found.over_noise.tolist()),
        noise_limit=found.noise_limit,
        bound=tuple(found.bound.largest.tolist()),
        band_hz=found.bound.band_hz,
    )
    return origin.model_copy(update={"refinements": (*origin.refinements, entry)})


def _refuse_other_cell(reference: MotionRun, loaded: LoadedCell) -> None:
    """Refuse a reference run of another robot or cell: delays and scales would be those of others.

    Raises:
        ConfigError: The run is of another robot or cell.
    """
    differences = list(loaded.robot.differences(reference.data.robot))
    if reference.cell.name != loaded.config.name:
        differences.append(f"cell ({reference.cell.name})")
    if differences:
        raise ConfigError(
            f"--reference: run {reference.run_id} differs from cell {loaded.config.name} with"
            f" robot {loaded.robot.name} in {', '.join(differences)}, so it does not show the"
            " delays of these drives: record the motion in this cell and give that run",
            code="RID-REFERENCE-CELL",
        )


def _refuse_mixed(driven: list[MotionRun]) -> None:
    for other in driven[1:]:
        if other.motion != driven[0].motion or other.file != driven[0].file:
            raise ConfigError(
                f"runs {driven[0].run_id} and {other.run_id} differ in motion or feedforward:"
                " refine with repetitions of the same motion and feedforward",
                code="RID-REFINE-RUNS",
            )


def _refuse_growth(measured: RepeatedError, origin: FeedforwardOrigin) -> None:
    """Refuse a refinement if the last one has increased the path error of all joints together.

    Raises:
        DataQualityError: The error has grown by more than 20 %; the text names the joint with the
            largest growth, and the remedy.
    """
    if not origin.refinements:
        return
    before = np.array(origin.refinements[-1].rms)
    grown = measured.rms / np.maximum(before, 1e-300)
    total = float(np.sqrt(np.square(measured.rms).sum() / np.square(before).sum()))
    if total > GROWN:
        worst = int(grown.argmax())
        raise DataQualityError(
            "the path error has grown since the last refinement, most in"
            f" {measured.joint_names[worst]} (from {before[worst]:.3g} to"
            f" {measured.rms[worst]:.3g}): the model or the loop file does not match the robot,"
            " its payload or its drives. Use the feedforward of run"
            f" {origin.refinements[-1].runs[0]}, and measure the loops again before the next"
            " refinement",
            code="RID-LOOP-OTHER",
        )


def _has_stalled(measured: RepeatedError, origin: FeedforwardOrigin) -> bool:
    """Return True if the last refinement has reduced no joint's path error by 10 % or more."""
    if not origin.refinements:
        return False
    before = np.array(origin.refinements[-1].rms)
    return bool((measured.rms > STALLED * before).all())
