"""`retime_motion`: time the path of a motion file to the limits of a model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.motion.limits import verify_limits
from acquisition.motion.samples import MotionSamples
from compensation.operating_temperature import WARM, at_operating_temperature
from compensation.timing.limits import TimingLimits
from compensation.timing.timed_motion import TimedMotion, retimed, weighed
from config.arrays import FloatArray
from config.errors import ConfigError, LimitError
from config.formats.whole_file import write_whole
from config.load import LoadedCell, load_cell, to_yaml
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import torque
from dynamics.terms.conditions import Conditions
from identification.calibration.base_reaction import base_limits
from identification.estimation.estimate import Estimate, predict
from identification.payload.body import flange_pose, to_link
from identification.payload.estimate import PayloadEstimate
from identification.payload.file import read_payload, refuse_failed
from rid_daq.operations.cell_files import estimate_for, motion_for
from rid_daq.operations.path.retime import RetimeRequest
from rid_daq.report.result import Result
from rid_daq.report.sections.retiming import RetimingSection
from rid_daq.report.sections.verdict import VerdictSection
from rid_daq.report_page.render import render_report
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output

BY_TIME: Final = {
    "fourier": "its periods",
    "reversed": "its periods, there and back,",
    "multisine": "its periods and frequencies",
    "constant_velocity": "its speeds",
}
"""Kinds of motion that measure by when the robot is where, and what of it would be lost."""


@dataclass(frozen=True)
class Retimed:
    """A motion that was timed and written.

    Attributes:
        timed: The motion.
        section: Its part of a report.
        notes: How warm joints are taken to be, where that matters.
    """

    timed: TimedMotion
    section: RetimingSection
    notes: list[str]


def retime_motion(request: RetimeRequest) -> Retimed:
    """Time a motion's path to its limits, and write the motion.

    Raises:
        ConfigError: Files do not belong together, an option is none, or a file is there already; or
            motion and page are to be one file.
        EstimationError: The payload did not pass its verdict.
        LimitError: A limit cannot be kept to; the text names it, and where.
    """
    refuse_output(request.output, request.overwrite, made_file.MOTION)
    refuse_output(request.report, request.overwrite, made_file.REPORT)
    if request.report is not None and request.report.resolve() == request.output.resolve():
        raise ConfigError(
            f"{request.report}: --report and --output name one file: give the page another name",
            code="RID-OPTION-EXCLUSIVE",
        )
    loaded = load_cell(request.cell)
    robot = loaded.robot
    motion = motion_for(request.motion, loaded)
    if motion.kind in BY_TIME:
        raise ConfigError(
            f"{request.motion}: a motion of kind {motion.kind} is there to measure by"
            f" {BY_TIME[motion.kind]}, which another timing would take away: give a path"
            " (joint_path, path, circle, joint_table, multipoint)",
            code="RID-MOTION-KIND",
        )
    estimate = estimate_for(request.model, robot)
    payload = None if request.payload is None else _payload(request.payload, robot)
    limits = _limits(request, loaded)
    if request.base:
        estimate = weighed(estimate, request.mass_kg)
    samples = motion.plan(robot, loaded.config.cycle_time_s)
    warm = at_operating_temperature(estimate, request.temperature, samples.whole().velocity)
    for again in (request.temperature == WARM, False):
        timed = retimed(
            samples, robot, warm.estimate, limits, confidence=request.confidence, payload=payload
        )
        if not again:
            break
        # What is faster heats more: the motion is timed to the warmth that it makes itself.
        faster = timed.motion.plan(robot, loaded.config.cycle_time_s).whole()
        warm = at_operating_temperature(estimate, request.temperature, faster.velocity)
    estimate = warm.estimate
    _hold_what_is_written(timed, robot, loaded.config.cycle_time_s, estimate, payload)
    section = RetimingSection.of(
        timed,
        robot,
        limits,
        named=(request.motion.name, request.model.name),
        confidence=request.confidence,
        margin=request.margin,
    )
    comment = (
        f"Timed by `rid-daq retime` from {request.motion.name} with the model"
        f" {request.model.name}: {timed.moving_s:.6g} s in place of {timed.original_s:.6g} s."
    )
    write_whole(request.output, to_yaml(timed.motion, comment).encode())
    if request.report is not None:
        page = Result.new(f"{request.motion.name} timed to its limits", robot.name).updated(
            verdict=VerdictSection.of(section.checks, "Within every limit", section.sentence),
            retiming=section,
        )
        write_whole(request.report, render_report(page).encode())
    return Retimed(timed, section, warm.notes)


def _limits(request: RetimeRequest, loaded: LoadedCell) -> TimingLimits:
    n = len(loaded.robot.joints)
    plate = loaded.config.plate
    if request.base and (plate is None or plate.limits is None):
        raise ConfigError(
            f"--base-limits: cell {loaded.config.name} has no `plate` with `limits`; add force_n"
            " and moment_nm there",
            code="RID-PLATE-NO-LIMITS",
        )
    own = plate.limits if request.base and plate is not None else None
    found = replace(
        TimingLimits.of_robot(loaded.robot),
        base=None if own is None else base_limits(own),
        torque_rate=_each("--torque-rate", request.torque_rate, n),
        jerk=_each("--jerk", request.jerk, n),
        torque_rms=_each("--rms-torque", request.torque_rms, n),
    )
    return found.keeping_free(request.margin)


def _each(option: str, values: tuple[float, ...], n: int) -> np.ndarray | None:
    if not values:
        return None
    if len(values) not in (1, n):
        raise ConfigError(
            f"{option} has {len(values)} values: give one, or one for each of {n}",
            code="RID-OPTION-COUNT",
        )
    if not all(value > 0.0 for value in values):
        raise ConfigError(f"{option} must be positive", code="RID-OPTION-RANGE")
    return np.array(values * n if len(values) == 1 else values)


def _payload(path: Path, robot: RobotDescription) -> PayloadEstimate:
    judged = read_payload(path)
    refuse_failed(path, judged, "no motion is timed with it")
    found = judged.estimate
    differences = robot.differences(found.robot)
    if differences:
        raise ConfigError(
            f"{path}: is of robot {found.robot.name!r}, which is not this {robot.name!r}: they"
            f" differ in {', '.join(differences)}",
            code="RID-ROBOT-OTHER",
        )
    hidden = found.seen_parameters.count(False)
    if hidden:
        raise ConfigError(
            f"{path}: its motion did not show {hidden} of the payload's ten parameters: identify it"
            " from a motion that does",
            code="RID-MOTION-UNINFORMATIVE",
        )
    return found


def _hold_what_is_written(
    timed: TimedMotion,
    robot: RobotDescription,
    cycle_s: float,
    estimate: Estimate,
    payload: PayloadEstimate | None,
) -> None:
    """Plan the motion as `record` will, and hold its rows against the robot and the model."""
    planned = timed.motion.plan(robot, cycle_s)
    verify_limits(planned, robot)
    taken = np.abs(_torque(estimate, payload, planned))
    for j, joint in enumerate(robot.joints):
        if taken[:, j].max() > joint.limits.torque * (1.0 + 1e-9):
            raise LimitError(
                f"the timed motion takes {taken[:, j].max():.6g} of joint {joint.name!r} when it"
                " is planned again: tell the makers",
                code="RID-INTERNAL-ERROR",
            )


def _torque(
    estimate: Estimate, payload: PayloadEstimate | None, samples: MotionSamples
) -> FloatArray:
    """Return the torques of a motion by the regressor, with what hangs on the flange."""
    motion = (samples.position, samples.velocity, samples.acceleration)
    if payload is None:
        return predict(estimate, *motion)
    model = replace(estimate.options, payload=True).build(estimate.robot)
    body = to_link(flange_pose(estimate.robot)) @ payload.values
    whole = np.concatenate([estimate.standard_values, body])
    return torque(model, *motion, whole, Conditions(payload=True))
