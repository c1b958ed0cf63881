"""Timed motions on the simulated arm with every unmodelled effect: identify the arm, time a path,
compensate its errors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from acquisition.motion.kinds.joint_path import JointPathMotion
from acquisition.motion.samples import MotionSamples, Phase
from acquisition.recording.recording import Recording
from compensation.compensated_motion import compensated_motion
from compensation.loops.velocity_loop import VelocityLoop
from compensation.timing.joint_curve import JointCurve, curves_of
from compensation.timing.limits import TimingLimits
from compensation.timing.timed_motion import retime_path
from config.arrays import FloatArray
from config.load import LoadedCell
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain, link_transforms
from dynamics.model.robot_model import RobotModel
from dynamics.model.true_parameters import true_parameters
from identification.estimation.estimate import Estimate, predict
from identification.model.base_parameters import base_parameters
from identification.model.options import ModelOptions
from tests.builders.known_model import known_estimate

pytestmark = pytest.mark.slow

PICK_AND_PLACE = (
    (-0.9, 0.35, 0.2), (-0.85, 0.1, 0.35), (0.0, -0.15, 0.5), (0.75, 0.1, 0.35), (0.8, 0.35, 0.2)
)  # fmt: skip
MECHANICS = 3.0
"""Mechanical acceleration limit, as a multiple of the acceleration limit in the robot file."""
RATE = 40.0
"""Torque rate that the velocity loops can follow [torque limits per second]."""

Drive = Callable[..., Recording]


def tool_error_m(robot: RobotDescription, wanted: FloatArray, found: FloatArray) -> FloatArray:
    chain = Chain.from_description(robot)
    way, made = (link_transforms(chain, q)[:, -1, :3, 3] for q in (wanted, found))
    return np.asarray(np.linalg.norm(made - way, axis=1))


def trapezoid_s(curve: JointCurve, model: Estimate, limits: TimingLimits, cycle_s: float) -> float:
    """Return the shortest time of trapezoidal profiles that keep speed, acceleration and torque."""
    begin, end = curve.ends
    length, best = end - begin, np.inf
    for speed in np.linspace(0.2, 2.0, 19):
        for change in np.geomspace(1.0, 40.0, 24):
            ramp_s = min(speed / change, np.sqrt(length / change))
            top = change * ramp_s
            total_s = ramp_s + length / top
            if total_s >= best:
                continue
            t = np.arange(0.0, total_s, cycle_s)
            rising, falling = np.minimum(t, ramp_s), np.minimum(total_s - t, ramp_s)
            place = begin + np.where(
                t < ramp_s,
                0.5 * change * rising**2,
                np.where(
                    total_s - t < ramp_s,
                    length - 0.5 * change * falling**2,
                    0.5 * top * ramp_s + top * (t - ramp_s),
                ),
            )
            rate = change * np.minimum(rising, falling)
            more = np.where(t < ramp_s, change, np.where(total_s - t < ramp_s, -change, 0.0))
            q, slope, bend = curve.at(place)
            v = slope * rate[:, np.newaxis]
            a = slope * more[:, np.newaxis] + bend * rate[:, np.newaxis] ** 2
            within = (np.abs(v) <= limits.speed).all() and (np.abs(a) <= limits.acceleration).all()
            if within and (np.abs(predict(model, q, v, a)) <= limits.torque).all():
                best = total_s
    return float(best)


def within_mechanics(robot: RobotDescription, share: float) -> RobotDescription:
    """Return a robot with its mechanical acceleration limits and a fraction of its torques."""
    joints = tuple(
        joint.model_copy(
            update={
                "limits": joint.limits.model_copy(
                    update={
                        "acceleration": MECHANICS * joint.limits.acceleration,
                        "torque": share * joint.limits.torque,
                    }
                )
            }
        )
        for joint in robot.joints
    )
    return robot.model_copy(update={"joints": joints})


def limits_of(robot: RobotDescription) -> TimingLimits:
    limits = TimingLimits.of_robot(robot)
    return replace(limits, torque_rate=RATE * limits.torque)


def pick_and_place(cell: LoadedCell, speed_fraction: float) -> MotionSamples:
    keys = {"kind": "joint_path", "robot": "ir361", "points": PICK_AND_PLACE, "jerk_time_s": 0.05}
    motion = JointPathMotion.model_validate({**keys, "speed_fraction": speed_fraction})
    return motion.plan(cell.robot, cell.config.cycle_time_s)


def drive_timed(
    drive: Drive,
    samples: MotionSamples,
    model: Estimate,
    loops: list[VelocityLoop],
    **more: FloatArray,
) -> Recording:
    return drive(compensated_motion(samples, model, loops), 3, **more)


@pytest.mark.parametrize("share", [1.0, 0.7])
def test_a_timed_pick_and_place_keeps_its_torque_limits_and_its_path(
    share: float, cell: LoadedCell, drive: Drive, model: Estimate, loops: list[VelocityLoop]
) -> None:
    cycle_s, robot = cell.config.cycle_time_s, within_mechanics(model.robot, share)
    model, limits = replace(model, robot=robot), limits_of(robot)
    usual = pick_and_place(cell, 1.0)
    timed = retime_path(usual, robot, model, limits, confidence=0.95)

    (way,) = curves_of(usual, [joint.limits.velocity for joint in robot.joints])[1]
    in_file = TimingLimits.of_robot(cell.robot)
    assert timed.moving_s < 0.8 * trapezoid_s(way.curve, model, in_file, cycle_s)
    assert timed.moving_s < 0.8 * timed.original_s
    assert timed.moving_s < trapezoid_s(way.curve, model, limits, cycle_s)

    samples = timed.motion.plan(robot, cycle_s)
    recorded = drive_timed(drive, samples, model, loops)
    reached = np.abs(recorded.torque_nm).max(axis=0) / limits.torque
    assert (reached <= 1.02).all()
    assert reached.max() > 0.95

    fast_m, slow_m = (
        tool_error_m(robot, motion.position, drive_timed(drive, motion, model, loops).position)[
            motion.phase == Phase.MAIN
        ]
        for motion in (samples, pick_and_place(cell, 0.5))
    )
    assert fast_m.mean() <= 4.0 * slow_m.mean()
    assert fast_m.max() <= 3.0 * slow_m.max()


def test_the_base_reaction_stays_within_its_limit(
    cell: LoadedCell, drive: Drive, model: Estimate, loops: list[VelocityLoop]
) -> None:
    """The motion is timed with parameters known to 1 %; the simulated base reaction is compared."""
    assert cell.plant is not None
    robot = within_mechanics(cell.robot, 1.0)
    whole = RobotModel.from_description(robot)
    base = base_parameters(whole, kind="combined")
    values = base.from_standard(true_parameters(whole, robot, cell.plant))
    combined = replace(
        known_estimate(cell, {}),
        robot=robot,
        options=ModelOptions(kind="combined"),
        base=base,
        values=values,
        covariance_residual=np.diag((0.01 * values) ** 2),
        covariance_jackknife=np.diag((0.01 * values) ** 2),
        residual_nm=model.residual_nm,
    )
    usual = pick_and_place(cell, 1.0)
    free = retime_path(usual, robot, combined, limits_of(robot))
    reached = np.abs(free.ways[0].wrench).max(axis=0)
    allowed = reached * np.array([0.8, 0.8, np.inf, 0.8, 0.8, 0.8])
    limits = replace(limits_of(robot), base=allowed)
    timed = retime_path(usual, robot, combined, limits, confidence=0.95)
    assert timed.moving_s > free.moving_s
    samples = timed.motion.plan(robot, cell.config.cycle_time_s)
    felt = np.zeros((len(samples), 6))
    drive_timed(drive, samples, model, loops, wrench=felt)
    share = np.abs(felt).max(axis=0) / allowed
    assert (share[3:] <= 1.02).all()
    assert (share[:3] <= 1.05).all()
