"""`track_runs`: compare measured with commanded positions, and write the report."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acquisition.runs.catalogue import find_runs
from acquisition.tracker.tracker_file import read_tracked_point
from compensation.feedforward.tool_side import tool_side_error
from compensation.ramped_load import RampedLoad
from config.errors import ConfigError, DataQualityError
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain
from identification.elasticity.transmitted_torque import lumped_motors
from identification.estimation.estimate import Estimate
from rid_daq.operations.cell_files import read_estimate_for, rejection_notes
from rid_daq.operations.path.tracking import TrackingRequest
from rid_daq.operations.stated_loads import require_same_changes, state_loads
from rid_daq.operations.stated_payload import payload_words
from rid_daq.report.sections.tracking import MOTOR_TORQUES, TrackingSection
from rid_daq.report.tool_error_entries import ToolSideSize
from rid_daq.report_page.write import write_result
from rid_daq.runs.changed_load import load_changes_of, require_known_outcomes
from rid_daq.runs.followed_motion import compare_with_motion, motor_lead
from rid_daq.runs.motion_runs import PLAIN, MotionRun, read_motion_run
from rid_daq.runs.run_data import all_defects, result_of
from rid_daq.terminal.console import as_command


@dataclass(frozen=True)
class TrackedRuns:
    """Path errors of runs.

    Attributes:
        pairs: Each run, with the run that it is compared with, if any.
        section: Section of the report, in the order of the runs.
        notes: Defects of the runs' data.
        report: Path of the first run's report.
    """

    pairs: list[tuple[MotionRun, MotionRun | None]]
    section: TrackingSection
    notes: list[str]
    report: Path


def track_runs(request: TrackingRequest) -> TrackedRuns:
    """Compare measured with commanded positions, and add the result to the first run's report.

    Raises:
        ConfigError: The runs are of several robots, a run of `against` is of another motion, a run
            is compared with itself, a compensated run is given as the uncompensated one, or the
            model is of another robot.
        DataQualityError: Two runs of `against` are of the same motion, or a run lacks the commanded
            positions.
        EstimationError: The model or its payload cannot be used.
        RecordingError, LockedError: A run cannot be read, or is still being recorded.
    """
    driven, others = (
        [
            read_motion_run(folder, unfinished=request.unfinished, changing_load=True)
            for folder in find_runs(request.runs, names)
        ]
        for names in (request.run, request.against)
    )
    first = driven[0]
    robot = first.data.robot
    notes = all_defects([one.data for one in (*driven, *others)])
    for one in (*driven, *others):
        other_tool = one.data.robot.tool_offset_m != robot.tool_offset_m
        if one.data.robot.differences(robot) or other_tool:
            raise ConfigError(
                f"run {one.run_id} is of robot {one.data.robot.name!r} (or of another version of"
                f" its file), but run {first.run_id} is of {robot.name!r}: compare runs of one"
                " robot",
                code="RID-ROBOT-OTHER",
            )
    pairs = [(one, _run_to_compare_with(one, others)) for one in driven]
    for other in others:
        if all(other is not before for _, before in pairs):
            raise ConfigError(
                f"--against {other.run_id}: this run is of another motion than the given runs;"
                " compare runs of the same motion",
                code="RID-TRACKING-AGAINST",
            )
    for one, before in pairs:
        _require_order(one, before)
    estimate = None
    loads: dict[str, Estimate | RampedLoad] = {}
    if request.model is not None:
        estimate = read_estimate_for(request.model, robot, despite_misfit=request.despite_misfit)
        notes += rejection_notes(request.model, estimate)
        stated = (request.model, request.payload, request.load_changes, request.runs)
        stated_loads = state_loads(estimate, *stated)
        for one in (*driven, *others):
            recorded = load_changes_of(one.data.folder)
            require_known_outcomes(recorded, f"run {one.run_id}")
            require_same_changes(stated_loads.changes, recorded, f"run {one.run_id}")
            loads[one.run_id] = stated_loads.as_driven(recorded)
    torques = MOTOR_TORQUES
    if estimate is not None:
        robot, differing = _with_stiffness(robot, estimate.robot)
        notes += differing
        torques = _torque_words(estimate, robot) + payload_words(request.payload)
    motions = [compare_with_motion(*pair, robot, loads) for pair in pairs]
    section = TrackingSection.of(motions, robot, torques=torques)
    if request.tracker:
        sizes = _tool_side_sizes(request, [one for one, _ in pairs], section)
        section = section.model_copy(update={"tool_side": sizes})
    result = result_of(first.data, notes).with_sections(
        title=f"Paths of {robot.name}", tracking=section, verdict=section.verdict
    )
    return TrackedRuns(pairs, section, notes, write_result(first.data.folder, result))


def _tool_side_sizes(
    request: TrackingRequest, driven: list[MotionRun], section: TrackingSection
) -> tuple[ToolSideSize, ...]:
    """Return the errors at the tool that the tracker files show, one per run.

    Raises:
        ConfigError: There are more or fewer tracker files than runs, or a file cannot be read.
        DataQualityError: A file does not fit its run.
    """
    if len(request.tracker) != len(driven):
        raise ConfigError(
            f"--tracker: {len(request.tracker)} files for {len(driven)} runs: give one file for"
            " each run, in the same order",
            code="RID-OPTION-COUNT",
        )
    sizes = []
    for path, one, motion in zip(request.tracker, driven, section.motions, strict=True):
        chain = Chain.from_description(one.data.robot)
        if request.point is not None:
            chain = replace(chain, tool_m=np.array(request.point))
        tracked = read_tracked_point(path)
        try:
            error = tool_side_error(
                chain, one.data.recording, tracked, motor_lead(one.data, one.file)
            )
        except DataQualityError as problem:
            raise DataQualityError(f"{path}: {problem}", code=problem.refusal) from None
        sizes.append(
            ToolSideSize.of(error, run=one.run_id, file=path.name, motor_mean_m=motion.after.mean_m)
        )
    return tuple(sizes)


def _torque_words(estimate: Estimate, robot: RobotDescription) -> str:
    """Return a phrase that names the torques of the model from which the deflection is computed.

    Args:
        robot: Robot with the motors' inertias, if they are known.
    """
    words = "the model's torques of the links (gravity and inertia, no friction"
    lumped = [
        joint.name
        for joint in robot.joints
        if joint.name in lumped_motors(estimate) and joint.motor_inertia_kg_m2 is None
    ]
    if lumped:
        words += f"; for {', '.join(lumped)} also rotor inertia, which the model cannot separate"
    return words + ")"


def _with_stiffness(
    robot: RobotDescription, model: RobotDescription
) -> tuple[RobotDescription, list[str]]:
    """Return a robot with stiffness and motor inertia of its model, and notes on differences."""
    joints, notes = [], []
    for joint, model_joint in zip(robot.joints, model.joints, strict=True):
        stated, newer = joint.stiffness_nm_rad, model_joint.stiffness_nm_rad
        if stated is not None and newer is not None and stated != newer:
            notes.append(
                f"stiffness_nm_rad of {joint.name} is {stated:g} in the run's robot file and"
                f" {newer:g} in the model; the model's value is used"
            )
        inertia = model_joint.motor_inertia_kg_m2 or joint.motor_inertia_kg_m2
        changes = {"stiffness_nm_rad": newer or stated, "motor_inertia_kg_m2": inertia}
        joints.append(joint.model_copy(update=changes))
    return robot.model_copy(update={"joints": tuple(joints)}), notes


def _require_order(after: MotionRun, before: MotionRun | None) -> None:
    """Refuse a run compared with itself, or an uncompensated run compared with a compensated one.

    Raises:
        ConfigError: The two runs must not be compared.
    """
    if before is None:
        return
    if before.run_id == after.run_id:
        raise ConfigError(
            f"--against {before.run_id}: a run cannot be compared with itself; give another run",
            code="RID-TRACKING-AGAINST",
        )
    if after.use == PLAIN and before.use != PLAIN:
        turned = as_command("tracking", before.run_id, "--against", after.run_id)
        raise ConfigError(
            f"--against {before.run_id}: this run was driven with compensation, but run"
            f" {after.run_id} without: exchange the two: {turned}",
            code="RID-TRACKING-AGAINST",
        )


def _run_to_compare_with(run: MotionRun, others: list[MotionRun]) -> MotionRun | None:
    """Return the run of the same motion to compare with; None without one.

    Raises:
        DataQualityError: Several runs are of this motion.
    """
    same = [other for other in others if other.motion == run.motion]
    if len(same) > 1:
        raise DataQualityError(
            f"runs {same[0].run_id} and {same[1].run_id} are of the same motion: give one"
            " --against per motion",
            code="RID-TRACKING-AGAINST",
        )
    return same[0] if same else None
