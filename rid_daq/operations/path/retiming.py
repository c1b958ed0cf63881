"""`retime_motion`: compute the fastest timing of a motion file within the limits of a model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.motion.limits import verify_limits
from compensation.operating_temperature import WARM, at_operating_temperature
from compensation.timing.limits import TimingLimits
from compensation.timing.timed_motion import TimedMotion, retime_path, with_robot_weight
from config.errors import ConfigError, LimitError
from config.formats.whole_file import write_whole
from config.load import LoadedCell, load_cell, to_yaml
from config.robot.robot import RobotDescription
from identification.calibration.base_reaction import base_limits
from identification.estimation.estimate import Estimate, predict
from rid_daq.operations.cell_files import read_motion_for, read_torque_model
from rid_daq.operations.path.model_doubts import model_doubts
from rid_daq.operations.path.retime import RetimeRequest
from rid_daq.operations.rigid_gears import rigid_gears_notes
from rid_daq.operations.stated_payload import payload_words, state_payload
from rid_daq.report.result import Result
from rid_daq.report.sections.retiming import RetimingSection
from rid_daq.report.sections.verdict import VerdictSection
from rid_daq.report_page.render import render_report
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output

BY_TIME: Final = {
    "fourier": "the periods",
    "reversed": "the forward and backward periods",
    "multisine": "the periods and frequencies",
    "constant_velocity": "the speeds",
}
"""For each kind of motion with which a quantity is measured: what retiming would change."""


@dataclass(frozen=True)
class RetimedMotion:
    """A path that was retimed and written.

    Attributes:
        timed: The retimed motion.
        section: Section of a report.
        notes: Assumed temperature of the joints, and reasons to doubt the model.
    """

    timed: TimedMotion
    section: RetimingSection
    notes: list[str]


def retime_motion(request: RetimeRequest) -> RetimedMotion:
    """Compute the fastest timing of a motion's path, and write the motion.

    Raises:
        ConfigError: The files do not belong together, an option is invalid, a file exists already,
            or motion and report have the same path.
        EstimationError: The model or its payload cannot be used.
        LimitError: A limit cannot be kept; the text names it and, if known, the pose.
        RecordingError: A file cannot be written, or the model is in a damaged run.
    """
    refuse_output(request.output, request.overwrite, made_file.MOTION)
    refuse_output(request.report, request.overwrite, made_file.REPORT)
    if request.report is not None and request.report.resolve() == request.output.resolve():
        raise ConfigError(
            f"{request.report}: --report and --output name the same file: give the report another"
            " name",
            code="RID-OPTION-EXCLUSIVE",
        )
    loaded = load_cell(request.cell)
    robot = loaded.robot
    motion = read_motion_for(request.motion, loaded)
    if motion.kind in BY_TIME:
        raise ConfigError(
            f"{request.motion}: retiming would change {BY_TIME[motion.kind]} of this motion of kind"
            f" {motion.kind}, which the measurement needs: give a path"
            " (joint_path, path, circle, joint_table, multipoint)",
            code="RID-MOTION-KIND",
        )
    misfit = request.despite_misfit
    estimate = read_torque_model(request.model, robot, despite_misfit=misfit)[0]
    estimate = state_payload(estimate, request.model, request.payload, request.runs).estimate
    limits = _timing_limits(request, loaded)
    if request.base:
        estimate = with_robot_weight(estimate, request.mass_kg)
    samples = motion.plan(robot, loaded.config.cycle_time_s)
    warm = at_operating_temperature(estimate, request.temperature, samples.whole().velocity)
    for again in (request.temperature == WARM, False):
        timed = retime_path(samples, robot, warm.estimate, limits, confidence=request.confidence)
        if not again:
            break
        # The faster motion heats the joints more, so it is retimed again at the higher temperature.
        faster = timed.motion.plan(robot, loaded.config.cycle_time_s).whole()
        warm = at_operating_temperature(estimate, request.temperature, faster.velocity)
    estimate = warm.estimate
    _check_planned_motion(timed, robot, loaded.config.cycle_time_s, estimate)
    model = f"{request.model.name}{payload_words(request.payload)}"
    section = RetimingSection.of(
        timed,
        robot,
        limits,
        named=(request.motion.name, model),
        confidence=request.confidence,
        margin=request.margin,
    )
    comment = (
        f"Retimed by `rid-daq retime` from {request.motion.name} with the model {model}:"
        f" {timed.moving_s:.6g} s instead of {timed.original_s:.6g} s."
    )
    write_whole(request.output, to_yaml(timed.motion, comment).encode())
    if request.report is not None:
        page = Result.new(f"{request.motion.name} retimed to its limits", robot.name).with_sections(
            verdict=VerdictSection.of(section.checks, "All limits are kept", section.sentence),
            retiming=section,
        )
        write_whole(request.report, render_report(page).encode())
    doubts = model_doubts(request.model, estimate, samples.whole().position, loaded.config)
    rigid = rigid_gears_notes(
        request.model,
        estimate,
        "the limits are kept with the torques of rigid gears, which are right for a motion whose"
        " deflection `compensate` corrects",
    )
    return RetimedMotion(timed, section, [*warm.notes, *doubts, *rigid])


def _timing_limits(request: RetimeRequest, loaded: LoadedCell) -> TimingLimits:
    n = len(loaded.robot.joints)
    plate = loaded.config.plate
    if request.base and (plate is None or plate.limits is None):
        raise ConfigError(
            f"--base-limits: cell {loaded.config.name} has no `plate` with `limits`; add force_n"
            " and moment_nm there",
            code="RID-PLATE-NO-LIMITS",
        )
    plate_limits = plate.limits if request.base and plate is not None else None
    found = replace(
        TimingLimits.of_robot(loaded.robot),
        base=None if plate_limits is None else base_limits(plate_limits),
        torque_rate=_values_per_joint("--torque-rate", request.torque_rate, n),
        jerk=_values_per_joint("--jerk", request.jerk, n),
        torque_rms=_values_per_joint("--rms-torque", request.torque_rms, n),
    )
    return found.keeping_free(request.margin)


def _values_per_joint(option: str, values: tuple[float, ...], n: int) -> np.ndarray | None:
    if not values:
        return None
    if len(values) not in (1, n):
        raise ConfigError(
            f"{option} has {len(values)} values: give one value, or one for each of the {n} joints",
            code="RID-OPTION-COUNT",
        )
    if not all(value > 0.0 for value in values):
        raise ConfigError(f"{option}: all values must be positive", code="RID-OPTION-RANGE")
    return np.array(values * n if len(values) == 1 else values)


def _check_planned_motion(
    timed: TimedMotion, robot: RobotDescription, cycle_s: float, estimate: Estimate
) -> None:
    """Plan the motion as `record` does, and check its rows with the robot and the model."""
    planned = timed.motion.plan(robot, cycle_s)
    verify_limits(planned, robot)
    needed = np.abs(predict(estimate, planned.position, planned.velocity, planned.acceleration))
    for j, joint in enumerate(robot.joints):
        if needed[:, j].max() > joint.limits.torque * (1.0 + 1e-9):
            raise LimitError(
                f"internal error: the retimed motion needs {needed[:, j].max():.6g} of joint"
                f" {joint.name!r}, more than its torque limit; please report this",
                code="RID-INTERNAL-ERROR",
            )
