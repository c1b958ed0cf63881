"""Timing chapter of the demo: a pick-and-place path as fast as torques and base reaction allow."""

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
from compensation.timing.timed_motion import retime_path
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
from rid_daq.report.driven_timing_entry import DrivenPath, DrivenTiming
from rid_daq.report.sections.retiming import RetimingSection
from rid_daq.report.sections.runs import RunSection
from rid_daq.runs.followed_motion import path_error_of_run

MODEL: Final = "model_with_base.json"
MECHANICS: Final = 3.0
"""Acceleration limits of the arm's mechanics, as a multiple of the limits in the robot file, which
the drives can reach in every pose.
"""
RATE: Final = 40.0
"""Limit of the torque rate [torque limits per second]: the velocity loops can follow this rate."""
CONFIDENCE: Final = 0.95
PERIODS: Final = 3
MARGIN: Final = 0.05
"""Margin below the limits of torques and base reaction, as a fraction of these limits. It is needed
because the robot deviates from its set-points.
"""
BASE: Final = (350.0, 350.0, np.inf, 500.0, 420.0, 120.0)
"""Limits of the base reaction [N, N m]; without them, the fastest timing would exceed them.

The vertical force has no limit, because most of it is the weight.
"""
PICK_AND_PLACE: Final = (
    (-0.9, 0.35, 0.2), (-0.85, 0.1, 0.35), (0.0, -0.15, 0.5), (0.75, 0.1, 0.35), (0.8, 0.35, 0.2)
)  # fmt: skip


@dataclass(frozen=True)
class TimingMotions:
    """Motions of the chapter, and the robot with the acceleration limits of its mechanics.

    Attributes:
        robot: The bundled arm, with higher acceleration limits.
        excitation: Excitation for the force plate: the demo's own, with a few periods.
        pick_and_place: Path within the limits of the unchanged robot file.
    """

    robot: RobotDescription
    excitation: FourierMotion
    pick_and_place: JointPathMotion

    @classmethod
    def of_robot(cls, robot: RobotDescription, excitation: FourierMotion) -> TimingMotions:
        """Return the motions for the bundled arm."""
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
        """Return an upper limit of the duration of the chapter [s]; timing makes no path slower."""
        times = ((self.excitation, 1), (self.pick_and_place, 2))
        return sum(count * motion.plan(robot, cycle_time_s).duration_s for motion, count in times)

    def cell_with_robot(self, loaded: LoadedCell) -> LoadedCell:
        """Return a cell with this robot."""
        files = {**loaded.files, "robot.yaml": to_yaml(self.robot).encode()}
        return replace(loaded, robot=self.robot, files=files)


@dataclass(frozen=True)
class TimingChapter:
    """Result sections of the chapter."""

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
    """Retime a path with a model of joint torques and base reaction; record it before and after.

    Args:
        record: Records a motion on the cell with `motions.robot` and its force plate.
        motions: Motions of the chapter.
        robot: Robot of the unchanged robot file.
        by: Pre-compensation of the path, before and after it is timed.
        root: Folder for the model.

    Raises:
        RidDaqError: A step failed; the message names it.
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
    held = limits.keeping_free(MARGIN)
    timed = retime_path(usual, motions.robot, model, held, confidence=CONFIDENCE)
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
        run = record(name, motion, *by.with_feedforward(motion, planned.whole()))
        runs.append((name.capitalize(), motion, run))
        driven.append(_executed_path(run, motion.describe(), moving_s, model, limits))
    limited = np.isfinite(BASE)
    executed = DrivenTiming(
        before=driven[0],
        after=driven[1],
        components=tuple(np.array(WRENCH_NAMES)[limited].tolist()),
        limit=tuple(np.array(BASE)[limited].tolist()),
        sentence=(
            "Both paths are pre-compensated. The model of torques and base reaction comes from"
            f" {PERIODS} periods of the excitation on the force plate. Before timing, the path"
            " keeps the accelerations of the robot file, which are valid in every pose. After"
            f" timing, it keeps {MECHANICS:g} times these accelerations, all torque limits, and"
            " the limits of the base reaction; only the vertical force, mainly the weight, has no"
            " limit. The reaction is the model's value at rest before the motion, plus the change"
            " of the plate's signal since then."
        ),
    )
    section = RetimingSection.of(
        timed,
        motions.robot,
        held,
        named=("the pick-and-place path", MODEL),
        confidence=CONFIDENCE,
        margin=MARGIN,
    )
    plate = ("Excitation on the plate", motions.excitation, on_plate)
    torque = _main_part(runs[-1][2].measured.recording).torque_nm
    return TimingChapter(
        retiming=section.with_driven(executed, torque / held.torque),
        runs=tuple(
            RunSection.of(role, motion.describe(), run.measured.tally, motions.robot)
            for role, motion, run in (plate, *runs)
        ),
        run_ids=tuple(run.folder.run_id for _, _, run in (plate, *runs)),
    )


def _executed_path(
    run: RecordedRun, sentence: str, moving_s: float, model: Estimate, limits: TimingLimits
) -> DrivenPath:
    """Return path errors, torques and base reaction of a run from rest to rest."""
    data = run.measured
    error, recording = path_error_of_run(data), data.recording
    torque = np.abs(_main_part(recording).torque_nm).max(axis=0)
    return DrivenPath(
        sentence=sentence,
        moving_s=moving_s,
        mean_m=error.mean_m,
        max_m=error.max_m,
        torque_share=tuple((torque / limits.torque).tolist()),
        base_peak=tuple(_largest_base_wrench(recording, model)[np.isfinite(BASE)].tolist()),
    )


def _main_part(recording: Recording) -> Recording:
    return recording.part((recording.phase == Phase.MAIN) & recording.valid)


def _largest_base_wrench(recording: Recording, model: Estimate) -> FloatArray:
    """Return the largest base wrench of a motion, shape (6,).

    The zero of a force plate is unknown. The result is therefore a sum: the model's base wrench at
    rest before the motion, plus the change of the measured wrench since then.

    Raises:
        DataQualityError: The force plate was not valid all the time.
    """
    reaction = recording.reaction
    main = np.flatnonzero(recording.phase == Phase.MAIN)
    rest = np.flatnonzero((recording.phase == Phase.HOLD) & (recording.sample_index >= 0))
    rest = rest[rest < main[0]]
    if reaction is None or not reaction.valid[rest[0] : main[-1] + 1].all():
        raise DataQualityError(
            "the force plate was not valid all the time: the reaction on the base is unknown;"
            " record the motion again",
            code="RID-PLATE-CHANNEL",
        )
    pose = recording.position[rest].mean(axis=0, keepdims=True)
    zero = np.zeros_like(pose)
    at_rest = predict_base_wrench(model, pose, zero, zero)
    change = reaction.base_wrench[main] - reaction.base_wrench[rest].mean(axis=0)
    return np.asarray(np.abs(at_rest + change).max(axis=0))
