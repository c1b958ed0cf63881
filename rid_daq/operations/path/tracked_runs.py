"""`track_runs`: compare measured with commanded positions, and write the report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from acquisition.runs.catalogue import find_runs
from config.errors import ConfigError, DataQualityError
from config.robot.robot import RobotDescription
from identification.estimation.estimate import Estimate
from rid_daq.operations.cell_files import estimate_for
from rid_daq.operations.path.tracking import TrackingRequest
from rid_daq.report.sections.tracking import MOTOR_TORQUES, TrackingSection
from rid_daq.report_page.write import write_result
from rid_daq.runs.followed_motion import followed
from rid_daq.runs.motion_runs import PLAIN, MotionRun, read_motion_run
from rid_daq.runs.run_data import every_lack, result_of
from rid_daq.terminal.console import as_command


@dataclass(frozen=True)
class Tracked:
    """How closely motions were followed.

    Attributes:
        pairs: Each run, with the one that it is compared with.
        section: How closely, in their order.
        notes: What the runs lack.
        report: The first run's report.
    """

    pairs: list[tuple[MotionRun, MotionRun | None]]
    section: TrackingSection
    notes: list[str]
    report: Path


def track_runs(request: TrackingRequest) -> Tracked:
    """Compare positions reached with positions wanted, and put it into the first run's report.

    Raises:
        ConfigError: The runs are of several robots, or one of `against` is of another motion; or
            before and after are the same run, or were taken for each other. The model is of another
            robot.
        DataQualityError: Two of `against` are of one motion, or a run does not say where the robot
            should have been.
        EstimationError: A joint stood still when the model was identified.
    """
    driven, others = (
        [
            read_motion_run(folder, unfinished=request.unfinished)
            for folder in find_runs(request.runs, names)
        ]
        for names in (request.run, request.against)
    )
    first = driven[0]
    robot = first.data.robot
    notes = every_lack([one.data for one in (*driven, *others)])
    for one in (*driven, *others):
        other_tool = one.data.robot.tool_offset_m != robot.tool_offset_m
        if one.data.robot.differences(robot) or other_tool:
            raise ConfigError(
                f"run {one.run_id} is of robot {one.data.robot.name!r}, or of another state of its"
                f" file, run {first.run_id} of {robot.name!r}: compare runs of one",
                code="RID-ROBOT-OTHER",
            )
    pairs = [(one, _before(one, others)) for one in driven]
    for other in others:
        if all(other is not before for _, before in pairs):
            raise ConfigError(
                f"--against {other.run_id}: is of none of the motions given; compare runs of the"
                " same motion",
                code="RID-TRACKING-AGAINST",
            )
    for one, before in pairs:
        _require_order(one, before)
    estimate = None if request.model is None else estimate_for(request.model, robot)
    torques = MOTOR_TORQUES
    if estimate is not None:
        robot, differing = _with_stiffness(robot, estimate.robot)
        notes += differing
        torques = _torque_words(estimate)
    motions = [followed(*pair, robot, estimate) for pair in pairs]
    section = TrackingSection.of(motions, robot, torques=torques)
    result = result_of(first.data, notes).updated(
        title=f"Paths of {robot.name}", tracking=section, verdict=section.verdict
    )
    return Tracked(pairs, section, notes, write_result(first.data.folder, result))


def _torque_words(estimate: Estimate) -> str:
    """Say which torques of a model bend the gears."""
    words = "the model's torques of the links (gravity and inertia, no friction"
    names = estimate.robot.joint_names
    told = {f"{kind}{number}" for number in range(1, len(names) + 1) for kind in ("Im", "Ia")}
    told &= set(estimate.base.names)
    lumped = [
        name
        for number, name in enumerate(names, start=1)
        if told.isdisjoint((f"Im{number}", f"Ia{number}"))
    ]
    if lumped:
        words += (
            f"; of {', '.join(lumped)} the rotors' inertia too, which the model cannot separate"
        )
    return words + ")"


def _with_stiffness(
    robot: RobotDescription, model: RobotDescription
) -> tuple[RobotDescription, list[str]]:
    """Return a robot with the stiffness that its model states, and notes on what differs."""
    joints, notes = [], []
    for own, other in zip(robot.joints, model.joints, strict=True):
        stated, newer = own.stiffness_nm_rad, other.stiffness_nm_rad
        if stated is not None and newer is not None and stated != newer:
            notes.append(
                f"stiffness_nm_rad of {own.name}: {stated:g} in the run's robot file, {newer:g} in"
                " the model; the model's is used"
            )
        joints.append(own.model_copy(update={"stiffness_nm_rad": newer or stated}))
    return robot.model_copy(update={"joints": tuple(joints)}), notes


def _require_order(after: MotionRun, before: MotionRun | None) -> None:
    """Refuse a run that is compared with itself, or a plain one with a compensated one.

    Raises:
        ConfigError: It is so.
    """
    if before is None:
        return
    if before.run_id == after.run_id:
        raise ConfigError(
            f"--against {before.run_id}: is the run itself; give another run",
            code="RID-TRACKING-AGAINST",
        )
    if after.use == PLAIN and before.use != PLAIN:
        turned = as_command("tracking", before.run_id, "--against", after.run_id)
        raise ConfigError(
            f"--against {before.run_id}: is the compensated one, and run {after.run_id} was driven"
            f" without compensation: turn them round: {turned}",
            code="RID-TRACKING-AGAINST",
        )


def _before(run: MotionRun, others: list[MotionRun]) -> MotionRun | None:
    """Return the run to compare with: the one of the same motion.

    Raises:
        DataQualityError: There are several.
    """
    same = [other for other in others if other.motion == run.motion]
    if len(same) > 1:
        raise DataQualityError(
            f"runs {same[0].run_id} and {same[1].run_id} are of the same motion: give --against"
            " once for each",
            code="RID-TRACKING-AGAINST",
        )
    return same[0] if same else None
