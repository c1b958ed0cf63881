"""Path chapter of the demo: velocity loops, feedforward, paths with and without compensation."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Protocol

from acquisition.motion.kinds.circle import CircleMotion
from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.motion.kinds.tool_path import PathMotion
from acquisition.motion.motion_file import AnyMotion
from acquisition.motion.paths.segments import ArcSegment, LineSegment, SplineSegment
from acquisition.motion.samples import MotionSamples
from acquisition.runs.folder import RunFolder
from compensation.compensated_motion import compensated_motion
from compensation.feedforward.file import FeedforwardOrigin, TuningEntry, feedforward_bytes
from compensation.feedforward.repeated_error import repeated_error
from compensation.feedforward.tuning import Tuning, tune
from compensation.loops.frequency_response import frequency_responses
from compensation.loops.loop_file import write_loops
from compensation.loops.multisine_motion import MultisineOptions, multisine_motion
from compensation.loops.velocity_loop import VelocityLoop, fit_velocity_loop, in_order
from config.cell.cell import CellConfig
from config.robot.robot import RobotDescription
from identification.estimation.estimate import Estimate
from rid_daq.blocks.formats import format_measured
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.report.sections.runs import RunSection
from rid_daq.report.sections.tracking import TrackingSection
from rid_daq.runs.followed_motion import compare_with_motion
from rid_daq.runs.motion_runs import MotionRun, read_motion_run
from rid_daq.runs.run_data import FEEDFORWARD

NEAR: Final = (0.1, -0.1, 0.4)
BAND_HZ: Final = (0.75, 15.0)


class PathRecorder(Protocol):
    """Records a motion as its file describes it, or with given samples and files."""

    @abstractmethod
    def __call__(
        self,
        role: str,
        motion: AnyMotion,
        planned: MotionSamples | None = None,
        files: Mapping[str, bytes] | None = None,
    ) -> RecordedRun:
        """Record the motion and return the recorded run."""


@dataclass(frozen=True)
class PathMotions:
    """Motions of the chapter: multisines, a circle for tuning, and a path not used for tuning."""

    multisine: MultisineMotion
    circle: CircleMotion
    path: PathMotion

    @classmethod
    def of_cell(cls, robot: RobotDescription, cell: CellConfig, seed: int) -> PathMotions:
        """Return the motions for the bundled arm."""
        options = MultisineOptions(
            band_hz=BAND_HZ, period_s=4.0, periods=2, realisations=2, seed=seed
        )
        multisine = multisine_motion(robot, cell, options)
        return cls(
            multisine=multisine,
            circle=CircleMotion(
                kind="circle",
                robot=robot.name,
                centre_m=(0.575, -0.078, -1.724),
                radius_m=0.2,
                speed_m_s=0.6,
                near=NEAR,
                periods=4,
            ),
            path=PathMotion(
                kind="path",
                robot=robot.name,
                start_m=(0.60, -0.25, -1.70),
                near=NEAR,
                speed_m_s=0.4,
                blend_m=0.05,
                segments=(
                    LineSegment(kind="line", to_m=(0.60, 0.20, -1.70)),
                    ArcSegment(kind="arc", through_m=(0.72, 0.28, -1.70), to_m=(0.84, 0.20, -1.70)),
                    LineSegment(kind="line", to_m=(0.84, 0.05, -1.70)),
                    SplineSegment(
                        kind="spline",
                        through_m=(
                            (0.76, -0.05, -1.65),
                            (0.82, -0.15, -1.62),
                            (0.74, -0.26, -1.66),
                            (0.64, -0.28, -1.70),
                        ),
                    ),
                ),
            ),
        )

    def duration_s(self, robot: RobotDescription, cycle_time_s: float) -> float:
        """Return the duration of the chapter's motions [s]: multisine once, both paths twice."""
        times = ((self.multisine, 1), (self.circle, 2), (self.path, 2))
        return sum(count * motion.plan(robot, cycle_time_s).duration_s for motion, count in times)


@dataclass(frozen=True)
class Precompensation:
    """Data of a pre-compensation: a model, velocity loops, and their tuning from a run."""

    estimate: Estimate
    loops: list[VelocityLoop]
    tuning: Tuning
    reference: str

    def with_feedforward(
        self, motion: AnyMotion, planned: MotionSamples, *, same_motion: bool = False
    ) -> tuple[MotionSamples, dict[str, bytes]]:
        """Return a motion with its feedforward, and the feedforward file for its run."""
        ahead = compensated_motion(planned, self.estimate, self.loops, self.tuning.tuning)
        entry = TuningEntry.of(self.tuning, self.reference, same_motion)
        return ahead, {
            FEEDFORWARD: feedforward_bytes(motion, ahead, FeedforwardOrigin(tuning=entry))
        }


@dataclass(frozen=True)
class PathChapter:
    """Result sections of the chapter: path errors, their compensation, and the runs."""

    tracking: TrackingSection
    precompensation: Precompensation
    runs: tuple[RunSection, ...]
    run_ids: tuple[str, ...]


def run_path_chapter(
    record: PathRecorder,
    motions: PathMotions,
    robot: RobotDescription,
    cell: CellConfig,
    estimate: Estimate,
    root: RunFolder,
) -> PathChapter:
    """Run the chapter on the identified robot; return its result sections.

    The velocity loops are identified from a multisine. Torque scale and delay are tuned with the
    circle without compensation. The second path serves only to check the compensation.

    Raises:
        RidDaqError: A step failed; the message names it.
    """
    excited = record("multisine", motions.multisine)
    responses = frequency_responses(excited.measured.recording, motions.multisine, robot)
    fitted = [fit_velocity_loop(response) for response in responses]
    write_loops(root.path / "loops.json", fitted, robot.name, excited.folder.run_id, cell.name)
    loops = in_order(robot.joint_names, estimate.robot.joint_names, fitted)
    runs: list[tuple[str, AnyMotion, RecordedRun]] = [("Multisine", motions.multisine, excited)]
    pairs: list[tuple[MotionRun, MotionRun]] = []
    by: Precompensation | None = None
    for name, motion in (("circle", motions.circle), ("path", motions.path)):
        planned = motion.plan(robot, cell.cycle_time_s).whole()
        plain = record(f"{name}-plain", motion, planned)
        if by is None:
            measured = repeated_error(robot, planned, [plain.measured.recording])
            tuning = tune(planned, measured, estimate, loops, cell.position_gain_per_s)
            by = Precompensation(estimate, loops, tuning, plain.folder.run_id)
        ahead, files = by.with_feedforward(motion, planned, same_motion=motion is motions.circle)
        after = record(f"{name}-compensated", motion, ahead, files)
        runs += [(f"{name.capitalize()}, plain", motion, plain)]
        runs += [(f"{name.capitalize()}, compensated", motion, after)]
        pairs.append((read_motion_run(after.folder), read_motion_run(plain.folder)))
    assert by is not None
    more = f" {_loop_sentence(loops, by.tuning)}"
    return PathChapter(
        tracking=TrackingSection.of(
            [compare_with_motion(*pair, robot, {}) for pair in pairs], robot, more
        ),
        precompensation=by,
        runs=tuple(
            RunSection.of(role, motion.describe(), run.measured.tally, robot)
            for role, motion, run in runs
        ),
        run_ids=tuple(run.folder.run_id for _, _, run in runs),
    )


def _loop_sentence(loops: list[VelocityLoop], tuning: Tuning) -> str:
    """Return a sentence with the velocity loops and the tuning."""
    parts, tuned = [], []
    for loop, scale, delay_s in zip(
        loops, tuning.tuning.scale.tolist(), tuning.tuning.delay_s.tolist(), strict=True
    ):
        parts.append(
            f"{loop.joint_name}"
            f" {' ± '.join(format_measured(loop.gain, 2.0 * loop.sigma['gain']))} and"
            f" {1e3 * loop.integral_time_s:.4g} ms"
        )
        if (scale, delay_s) != (1.0, 0.0):
            tuned.append(
                f"{loop.joint_name} torque scale {scale:.3f}, delay {1e3 * delay_s:.2f} ms"
            )
    return (
        "Velocity loops from a multisine, gain [N m s/rad] and integral time:"
        f" {'; '.join(parts)}. Tuning from the circle without compensation:"
        f" {'; '.join(tuned) or 'not necessary'}."
    )
