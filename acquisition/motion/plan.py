"""`plan_motion`: from a motion file to verified samples that start and end at rest."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from acquisition.motion.approach import approach
from acquisition.motion.cartesian_path import path_motion
from acquisition.motion.circle import circle_motion
from acquisition.motion.constant_velocity import constant_velocity_runs, duration_s
from acquisition.motion.fourier import FourierTrajectory
from acquisition.motion.joint_path import joint_path_motion, joint_table_motion
from acquisition.motion.limits import beyond_limits, refuse, violations
from acquisition.motion.multipoint import multipoint_moves_s, multipoint_path
from acquisition.motion.multisine import realisation_motions
from acquisition.motion.path_geometry import stretches
from acquisition.motion.ramps import (
    Path,
    join,
    run_in,
    run_out,
    standstill,
)
from acquisition.motion.samples import MotionSamples, Phase, phases_of, verify_limits
from config.arrays import PhaseArray
from config.errors import ConfigError
from config.motion.motion import (
    AnyMotion,
    CircleMotion,
    ConstantVelocityMotion,
    FourierMotion,
    MultipointMotion,
    MultisineMotion,
    ReversedMotion,
)
from config.motion.path_motion import JointPathMotion, JointTableMotion, PathMotion
from config.robot.robot import RobotDescription

LONGEST_MOTION_S = 4 * 3600.0
RAMP_GROWTH = 1.25
RAMP_ATTEMPTS = 20
DWELL_S = 0.5


def plan_motion(
    motion: AnyMotion, robot: RobotDescription, sample_period_s: float
) -> MotionSamples:
    """Return the verified samples of a motion file; they start and end at rest.

    A periodic motion gets a run-in and a run-out along its own path; they are lengthened beyond
    `ramp_s` where the limits ask for it.

    Parameters
    ----------
    motion : AnyMotion
        What the robot is to do. Reversed motions and multisines are planned as several periodic
        ones, and count as not periodic as a whole.
    robot : RobotDescription
        Joints and limits.
    sample_period_s : float
        The cell's cycle time [s].

    Raises
    ------
    ConfigError
        The motion does not fit the robot, the cycle time or a limit; the text names the joint, the
        value and the limit.
    """
    _refuse_endless(motion)
    if isinstance(motion, FourierMotion):
        samples = _plan_fourier(motion, robot, sample_period_s)
    elif isinstance(motion, CircleMotion):
        turns = circle_motion(motion, robot, sample_period_s)
        samples = _plan_fourier(turns, robot, sample_period_s)
    elif isinstance(motion, ReversedMotion):
        parts = [motion.there(), motion.back()]
        samples = _plan_parts(parts, robot, sample_period_s, motion.dwell_s)
    elif isinstance(motion, MultisineMotion):
        samples = _plan_parts(realisation_motions(motion, robot), robot, sample_period_s, DWELL_S)
    elif isinstance(motion, PathMotion | JointPathMotion | JointTableMotion):
        samples = _plan_path(motion, robot, sample_period_s)
    else:
        if isinstance(motion, MultipointMotion):
            seconds = sum(multipoint_moves_s(motion, robot)) + motion.points * motion.dwell_s
            what = f"its {motion.points} points at {motion.speed_fraction:g} of the joints' speed"
            _refuse_longer(seconds, what)
            path = multipoint_path(motion, robot, sample_period_s)
        else:
            path, _ = constant_velocity_runs(motion, robot, sample_period_s)
        samples = MotionSamples(
            robot.joint_names, sample_period_s, *path, phases_of((Phase.MAIN, len(path.position)))
        )
    verify_limits(samples, robot)
    return samples


def _plan_path(
    motion: PathMotion | JointPathMotion | JointTableMotion,
    robot: RobotDescription,
    sample_period_s: float,
) -> MotionSamples:
    """Return a path with its rests before and after; rows in between are its main part."""
    if isinstance(motion, PathMotion):
        path = path_motion(motion, robot, sample_period_s)
    elif isinstance(motion, JointPathMotion):
        path = joint_path_motion(motion, robot, sample_period_s)
    else:
        path = joint_table_motion(motion, robot, sample_period_s)
    rest = max(1, math.ceil(motion.dwell_s / sample_period_s))
    rows = len(path.position)
    phase = phases_of((Phase.HOLD, rest), (Phase.MAIN, rows - 2 * rest), (Phase.HOLD, rest))
    return MotionSamples(robot.joint_names, sample_period_s, *path, phase)


def _refuse_endless(motion: AnyMotion) -> None:
    if isinstance(motion, MultipointMotion | JointPathMotion):
        return
    if isinstance(motion, PathMotion):
        length_m = sum(part.length_m for part in stretches(motion))
        slowest = min([s.speed_m_s or motion.speed_m_s for s in motion.segments])
        _refuse_longer(length_m / slowest, f"{length_m:.4g} m at {slowest:g} m/s")
        return
    if isinstance(motion, JointTableMotion):
        _refuse_longer(max(motion.time_s) - min(motion.time_s), "the times of its table")
        return
    if isinstance(motion, ConstantVelocityMotion):
        seconds, what = duration_s(motion), "its runs"
    else:
        periods = motion.transient_periods + motion.periods
        parts = 1
        if isinstance(motion, ReversedMotion):
            parts = 2
        elif isinstance(motion, MultisineMotion):
            parts = motion.realisations
        seconds = parts * (periods * motion.period_s + 2 * motion.ramp_s)
        what = f"{parts * periods} periods of {motion.period_s:.6g} s and its ramps"
    _refuse_longer(seconds, what)


def _refuse_longer(seconds: float, what: str) -> None:
    if seconds > LONGEST_MOTION_S:
        raise ConfigError(
            f"the motion takes {seconds:.6g} s: {what}; at most {LONGEST_MOTION_S:g} s can be run."
            " Give fewer or shorter ones"
        )


def _plan_fourier(
    motion: FourierMotion, robot: RobotDescription, sample_period_s: float
) -> MotionSamples:
    trajectory = FourierTrajectory.from_motion(motion, robot, sample_period_s)
    times_s = trajectory.sample_times_s
    period = Path(
        trajectory.position(times_s),
        trajectory.velocity(times_s),
        trajectory.acceleration(times_s),
    )
    first_row = Path(*(values[:1] for values in period))
    refuse(violations(join([period, first_row]), robot, sample_period_s), "the periodic motion")
    start, end = _ramps(trajectory, motion.ramp_s, robot)
    repeats = motion.transient_periods + motion.periods
    path = join([start, *[period] * repeats, end])
    return MotionSamples(
        robot.joint_names,
        sample_period_s,
        *path,
        phase=phases_of(
            (Phase.RUN_IN, len(start.position)),
            (Phase.TRANSIENT, motion.transient_periods * trajectory.samples_per_period),
            (Phase.MAIN, motion.periods * trajectory.samples_per_period),
            (Phase.RUN_OUT, len(end.position)),
        ),
        samples_per_period=trajectory.samples_per_period,
        periods=motion.periods,
    )


def _plan_parts(
    parts: Sequence[FourierMotion],
    robot: RobotDescription,
    sample_period_s: float,
    dwell_s: float,
) -> MotionSamples:
    """Return periodic motions one after the other, with a move and a rest between them."""
    planned = [_plan_fourier(part, robot, sample_period_s) for part in parts]
    paths: list[Path] = []
    phases: list[PhaseArray] = []
    for number, part in enumerate(planned):
        if number > 0:
            last = planned[number - 1].position[-1]
            rest = standstill(last, max(1, math.ceil(dwell_s / sample_period_s)))
            way = approach(last, part.position[0], robot, sample_period_s)
            paths += [rest, Path(way.position, way.velocity, way.acceleration)]
            phases.append(phases_of((Phase.HOLD, len(rest.position) + len(way))))
        paths.append(Path(part.position, part.velocity, part.acceleration))
        phases.append(part.phase)
    return MotionSamples(robot.joint_names, sample_period_s, *join(paths), np.concatenate(phases))


def _ramps(
    trajectory: FourierTrajectory, ramp_s: float, robot: RobotDescription
) -> tuple[Path, Path]:
    """Return run-in and run-out, as long as asked for or as much longer as the limits need."""
    sample_period_s = trajectory.sample_period_s
    rows = max(2, math.ceil(ramp_s / sample_period_s - 1e-6))
    broken: list[str] = []
    for _ in range(RAMP_ATTEMPTS):
        start, end = run_in(trajectory, rows), run_out(trajectory, rows)
        joined = join([start, Path(*(values[:1] for values in end))])
        broken = [
            *violations(joined, robot, sample_period_s),
            *violations(end, robot, sample_period_s),
        ]
        if not broken:
            return start, end
        rows = math.ceil(rows * RAMP_GROWTH)
    raise beyond_limits(broken, f"a ramp of {ramp_s:g} s, and any longer one tried,")
