"""The demo's chapter on time: a pick-and-place path as fast as torques and base allow, driven."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.kinds.joint_path import JointPathMotion
from acquisition.motion.motion_file import AnyMotion
from acquisition.motion.samples import Phase
from acquisition.recording.plate_geometry import WRENCH_NAMES
from acquisition.recording.recording import Recording
from acquisition.runs.folder import RunFolder
from compensation.timing.limits import TimingLimits
from compensation.timing.timed_motion import retimed
from config.arrays import FloatArray
from config.errors import DataQualityError
from config.load import LoadedCell, to_yaml
from config.robot.robot import RobotDescription
from identification.estimation.estimate import Estimate, predict_base_wrench
from identification.estimation.file import write_estimate
from identification.estimation.fitted_periods import fit_periodic
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from rid_daq.demo.demo_paths import PathRecorder, Precompensation
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.report.sections.retiming import RetimingSection
from rid_daq.report.sections.runs import RunSection
from rid_daq.report.sections.tracking import DrivenPath, DrivenTiming
from rid_daq.runs.followed_motion import path_error_of_run

MODEL: Final = "model_with_base.json"
MECHANICS: Final = 3.0
"""Times the robot file's accelerations, which hold in every pose: what the arm itself bears."""
RATE: Final = 40.0
"""Torque limits a second: what the velocity loops follow."""
CONFIDENCE: Final = 0.95
PERIODS: Final = 3
KEPT_FREE: Final = 0.05
"""Of torques and base reaction: for what the robot does not follow."""
BASE: Final = (350.0, 350.0, np.inf, 500.0, 420.0, 120.0)
"""What the foundation bears [N, N m], the weight left out; the fastest timing would take more."""
PICK_AND_PLACE: Final = (
    (-0.9, 0.35, 0.2), (-0.85, 0.1, 0.35), (0.0, -0.15, 0.5), (0.75, 0.1, 0.35), (0.8, 0.35, 0.2)
)  # fmt: skip


@dataclass(frozen=True)
class TimingMotions:
    """What the chapter drives, and on what: the robot with what its mechanics bear.

    Attributes:
        robot: The bundled arm, with higher limits of acceleration.
        excitation: Of the plate: the demo's own, a few periods.
        pick_and_place: Within the limits of the robot file as it is.
    """

    robot: RobotDescription
    excitation: FourierMotion
    pick_and_place: JointPathMotion

    @classmethod
    def of_robot(cls, robot: RobotDescription, excitation: FourierMotion) -> TimingMotions:
        """Return those of the bundled arm."""
        joints = tuple(
            joint.model_copy(update={"limits": joint.limits.model_copy(update={"acceleration": a})})
            for joint in robot.joints
            for a in [MECHANICS * joint.limits.acceleration]
        )
        return cls(
            robot=robot.model_copy(update={"joints": joints}),
            excitation=excitation.model_copy(update={"periods": PERIODS}),
            pick_and_place=JointPathMotion(
                kind="joint_path",
                robot=robot.name,
                points=PICK_AND_PLACE,
                speed_fraction=1.0,
                jerk_time_s=0.05,
            ),
        )

    def duration_s(self, robot: RobotDescription, cycle_time_s: float) -> float:
        """Return how long the chapter moves, at most: what is timed takes no longer than before."""
        times = ((self.excitation, 1), (self.pick_and_place, 2))
        return sum(count * motion.plan(robot, cycle_time_s).duration_s for motion, count in times)

    def loaded(self, loaded: LoadedCell) -> LoadedCell:
        """Return a cell with this robot in it."""
        files = {**loaded.files, "robot.yaml": to_yaml(self.robot).encode()}
        return replace(loaded, robot=self.robot, files=files)


@dataclass(frozen=True)
class TimingChapter:
    """What the chapter adds to a result."""

    retiming: RetimingSection
    runs: tuple[RunSection, ...]
    run_ids: tuple[str, ...]


def run_timing_chapter(
    record: PathRecorder,
    motions: TimingMotions,
    robot: RobotDescription,
    by: Precompensation,
    root: RunFolder,
) -> TimingChapter:
    """Time a path by a model that knows the reaction on the base; drive it before and after.

    Args:
        record: On the cell with `motions.robot` and its plate.
        motions: What is driven.
        robot: As its file has it.
        by: What pre-compensates both.
        root: Where the model is written.

    Raises:
        RidDaqError: A step failed; the message says which.
    """
    on_plate = record("plate", motions.excitation)
    cell = on_plate.measured.cell
    assert cell is not None
    model = fit_periodic(
        motions.robot,
        [on_plate.measured.average],
        EstimationOptions(model=ModelOptions(kind="combined")),
    ).estimate(cell_name=cell.name)
    write_estimate(root.path / MODEL, model)
    limits = TimingLimits.of_robot(motions.robot)
    limits = replace(limits, torque_rate=RATE * limits.torque, base=np.array(BASE))
    usual = motions.pick_and_place.plan(robot, cell.cycle_time_s).whole()
    held = limits.keeping_free(KEPT_FREE)
    timed = retimed(usual, motions.robot, model, held, confidence=CONFIDENCE)
    root.write("timed.yaml", to_yaml(timed.motion, "The demo's timed path.").encode())
    moved = (
        ("pick-and-place", motions.pick_and_place, usual, timed.original_s),
        (
            "timed",
            timed.motion,
            timed.motion.plan(motions.robot, cell.cycle_time_s),
            timed.moving_s,
        ),
    )
    runs: list[tuple[str, AnyMotion, RecordedRun]] = []
    driven: list[DrivenPath] = []
    for name, motion, planned, moving_s in moved:
        run = record(name, motion, *by.ahead(motion, planned.whole()))
        runs.append((name.capitalize(), motion, run))
        driven.append(_driven(run, motion.describe(), moving_s, model, limits))
    limited = np.isfinite(BASE)
    told = DrivenTiming(
        before=driven[0],
        after=driven[1],
        components=tuple(np.array(WRENCH_NAMES)[limited].tolist()),
        limit=tuple(np.array(BASE)[limited].tolist()),
        sentence=(
            f"Both pre-compensated. The model of torques and base reaction comes from {PERIODS}"
            " periods of the excitation on the force plate. Before, the path keeps to the"
            " accelerations of the robot file, which hold in every pose; timed, to"
            f" {MECHANICS:g} times those, to all torques, and to what the base may take, the"
            " weight left out. The reaction is what the plate measured since the rest before the"
            " motion."
        ),
    )
    section = RetimingSection.of(
        timed,
        motions.robot,
        held,
        named=("the pick-and-place path", MODEL),
        confidence=CONFIDENCE,
        margin=KEPT_FREE,
    )
    plate = ("Excitation on the plate", motions.excitation, on_plate)
    torque = _main(runs[-1][2].measured.recording).torque_nm
    return TimingChapter(
        retiming=section.with_driven(told, torque / held.torque),
        runs=tuple(
            RunSection.of(role, motion.describe(), run.measured.tally, motions.robot)
            for role, motion, run in (plate, *runs)
        ),
        run_ids=tuple(run.folder.run_id for _, _, run in (plate, *runs)),
    )


def _driven(
    run: RecordedRun, sentence: str, moving_s: float, model: Estimate, limits: TimingLimits
) -> DrivenPath:
    """Return what a run of a path from rest to rest measured."""
    data = run.measured
    error, recording = path_error_of_run(data), data.recording
    torque = np.abs(_main(recording).torque_nm).max(axis=0)
    return DrivenPath(
        sentence=sentence,
        moving_s=moving_s,
        mean_m=error.mean_m,
        max_m=error.max_m,
        torque_share=tuple((torque / limits.torque).tolist()),
        base_peak=tuple(_reaction(recording, model)[np.isfinite(BASE)].tolist()),
    )


def _main(recording: Recording) -> Recording:
    return recording.part((recording.phase == Phase.MAIN) & recording.valid)


def _reaction(recording: Recording, model: Estimate) -> FloatArray:
    """Return the largest base wrench of a motion, (6,).

    A plate's zero is unknown, so what it changes by since the rest before the motion is added to
    what the model says of that rest.

    Raises:
        DataQualityError: The plate was not valid all the time.
    """
    reaction = recording.reaction
    main = np.flatnonzero(recording.phase == Phase.MAIN)
    rest = np.flatnonzero((recording.phase == Phase.HOLD) & (recording.sample_index >= 0))
    rest = rest[rest < main[0]]
    if reaction is None or not reaction.valid[rest[0] : main[-1] + 1].all():
        raise DataQualityError(
            "the force plate was not valid all the time: the reaction on the base is not known",
            code="RID-PLATE-CHANNEL",
        )
    pose = recording.position[rest].mean(axis=0, keepdims=True)
    still = np.zeros_like(pose)
    standing = predict_base_wrench(model, pose, still, still)
    change = reaction.base_wrench[main] - reaction.base_wrench[rest].mean(axis=0)
    return np.asarray(np.abs(standing + change).max(axis=0))
