"""Feedforward files: computed from model and loops, refined by the error of runs with it."""

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
from compensation.compensated_motion import compensated_motion, refuse_torque, with_period
from compensation.feedforward.file import (
    FeedforwardOrigin,
    RefinementEntry,
    TuningEntry,
    write_feedforward,
)
from compensation.feedforward.refinement import Refinement, refinement
from compensation.feedforward.repeated_error import RepeatedError, repeated_error
from compensation.feedforward.tuning import tune
from compensation.loops import loop_file
from compensation.loops.velocity_loop import VelocityLoop
from compensation.online.online import in_order
from compensation.operating_temperature import at_operating_temperature
from config.errors import ConfigError, DataQualityError
from config.formats.approved_files import sha256_of
from config.formats.json_file import read_content
from config.load import load_cell
from identification.estimation.estimate import Estimate
from rid_daq.operations.cell_files import estimate_and_bytes, loops_and_bytes, motion_for
from rid_daq.operations.path.compensate import CompensateRequest
from rid_daq.operations.path.refine import RefineRequest
from rid_daq.runs import made_file
from rid_daq.runs.motion_runs import MotionRun, read_motion_run
from rid_daq.runs.origins import cell_of
from rid_daq.runs.output_file import refuse_output
from rid_daq.runs.run_data import MOTION, lacks

GROWN: Final = 1.2
STALLED: Final = 0.9


@dataclass(frozen=True)
class Compensated:
    """A feedforward that was written.

    Attributes:
        rows: Rows of the motion.
        largest: The largest correction of each joint's speed, by its name [rad/s or m/s].
        tuning: What the reference run tuned.
        notes: What that run lacks, and how warm joints are taken to be.
    """

    rows: int
    largest: dict[str, float]
    tuning: TuningEntry | None
    notes: list[str]


@dataclass(frozen=True)
class Refined:
    """A feedforward that was refined, or needs no more of it.

    Attributes:
        measured: What the robot missed.
        found: What that asks for.
        stalled: Whether the error no longer shrinks.
        notes: What the runs lack, and how warm joints are taken to be.
        cell: The runs' cell, as commands take it.
        motion: The motion file of one of the runs.
    """

    measured: RepeatedError
    found: Refinement
    stalled: bool
    notes: list[str]
    cell: str
    motion: Path

    @property
    def finished(self) -> bool:
        """Whether the feedforward is the one that the run had."""
        return self.found.finished or self.stalled


def compensate_motion(request: CompensateRequest) -> Compensated:
    """Compute a motion's feedforward and write it.

    Raises:
        ConfigError: Files do not belong together, or the file is there already.
        RidDaqError: The reference run cannot be used, or the motion takes more than the limits.
    """
    refuse_output(request.output, request.overwrite, made_file.FEEDFORWARD)
    loaded = load_cell(request.cell)
    motion = motion_for(request.motion, loaded)
    loops, loops_bytes = loops_and_bytes(request.loop, loaded)
    samples = motion.plan(loaded.robot, loaded.config.cycle_time_s)
    modelled, model_bytes = estimate_and_bytes(request.model, loaded.robot)
    warm = at_operating_temperature(modelled, request.temperature, samples.whole().velocity)
    estimate, notes = warm.estimate, warm.notes
    tuning = None
    if request.reference is not None:
        folder = find_run(request.runs, request.reference)
        driven = read_motion_run(folder, unfinished=request.unfinished)
        notes = [*lacks([driven.data]), *notes]
        tuning = _tuned(driven, motion, estimate, loops)
    compensated = compensated_motion(
        samples, estimate, loops, None if tuning is None else tuning.as_tuning()
    )
    verify_limits(compensated, loaded.robot)
    verify_command(compensated, loaded.config, loaded.robot)
    refuse_torque(motion, samples, estimate, loaded.robot)
    origin = FeedforwardOrigin(
        model_sha256=sha256_of(model_bytes),
        loops_sha256=sha256_of(loops_bytes),
        temperature=request.temperature or "",
        tuning=tuning,
    )
    write_feedforward(request.output, motion, compensated, origin)
    assert compensated.feedforward is not None
    more = np.abs(compensated.feedforward - compensated.velocity).max(axis=0)
    largest = dict(zip(loaded.robot.joint_names, more.tolist(), strict=True))
    return Compensated(len(samples), largest, tuning, notes)


def refine_feedforward(request: RefineRequest) -> Refined:
    """Correct a feedforward by what the robot missed with it, and write the next one.

    Raises:
        ConfigError: Runs differ in motion or feedforward, or the file is there already.
        DataQualityError: The error has grown since the last refinement.
    """
    refuse_output(request.output, request.overwrite, made_file.FEEDFORWARD)
    folders = find_runs(request.runs, request.run)
    driven = [read_motion_run(folder, unfinished=request.unfinished) for folder in folders]
    first = driven[0]
    _refuse_mixed(driven)
    samples = first.samples()
    modelled, model_bytes = estimate_and_bytes(request.model, first.data.robot)
    warm = at_operating_temperature(modelled, request.temperature, samples.whole().velocity)
    estimate = warm.estimate
    names = samples.joint_names
    loops_bytes = read_content(request.loop, loop_file.LARGEST_FILE_BYTES)
    measured_loops = loop_file.loops_content(loops_bytes, request.loop)[1]
    loops = in_order(names, estimate.robot.joint_names, measured_loops)
    measured = repeated_error(samples, [one.data.recording for one in driven])
    origin = FeedforwardOrigin() if first.file is None else first.file.origin
    _refuse_growth(measured, origin)
    found = refinement(samples, measured, estimate, loops, first.cell.position_gain_per_s)
    notes = [*lacks([one.data for one in driven]), *warm.notes]
    folder = first.data.folder
    refined = Refined(
        measured,
        found,
        _stalled(measured, origin),
        notes,
        cell_of(folder),
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
                "loops_sha256": sha256_of(loops_bytes),
                "temperature": request.temperature or "",
            }
        )
        ahead = ahead + more
    following = replace(samples, feedforward=ahead)
    verify_limits(following, first.data.robot)
    verify_command(following, first.cell, first.data.robot)
    write_feedforward(request.output, first.motion, following, origin)
    return refined


def _tuned(
    run: MotionRun, motion: AnyMotion, estimate: Estimate, loops: Sequence[VelocityLoop]
) -> TuningEntry:
    """Return what a reference run says of scale and delay."""
    samples = run.samples()
    ordered = in_order(samples.joint_names, estimate.robot.joint_names, loops)
    measured = repeated_error(samples, [run.data.recording])
    found = tune(samples, measured, estimate, ordered, run.cell.position_gain_per_s)
    return TuningEntry.of(found, run.run_id, run.motion == motion)


def _refined_origin(
    origin: FeedforwardOrigin, refined: Refined, runs: tuple[str, ...]
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


def _refuse_mixed(driven: list[MotionRun]) -> None:
    for other in driven[1:]:
        if other.motion != driven[0].motion or other.file != driven[0].file:
            raise ConfigError(
                f"runs {driven[0].run_id} and {other.run_id} differ in motion or feedforward:"
                " refine from repetitions of one",
                code="RID-REFINE-RUNS",
            )


def _refuse_growth(measured: RepeatedError, origin: FeedforwardOrigin) -> None:
    """Refuse to go on where the last refinement has made things worse.

    Raises:
        DataQualityError: It has; the text says in which joint, and what to do.
    """
    if not origin.refinements:
        return
    before = np.array(origin.refinements[-1].rms)
    grown = measured.rms / np.maximum(before, 1e-300)
    total = float(np.sqrt(np.square(measured.rms).sum() / np.square(before).sum()))
    if total > GROWN:
        worst = int(grown.argmax())
        raise DataQualityError(
            f"the error has grown since the last refinement, most in {measured.joint_names[worst]}"
            f" ({before[worst]:.3g} to {measured.rms[worst]:.3g}): robot, payload or loops are not"
            " those of model and loops. Use the feedforward of run"
            f" {origin.refinements[-1].runs[0]}, and measure the loops again before you go on",
            code="RID-LOOP-OTHER",
        )


def _stalled(measured: RepeatedError, origin: FeedforwardOrigin) -> bool:
    """Return whether the last refinement has changed next to nothing in any joint."""
    if not origin.refinements:
        return False
    before = np.array(origin.refinements[-1].rms)
    return bool((measured.rms > STALLED * before).all())
