"""`MotionSamples`: a motion as the cyclic task streams it, one row a cycle, verified."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.arrays import FloatArray, PhaseArray, read_only
from acquisition.circle import circle_motion
from acquisition.constant_velocity import constant_velocity_runs, duration_s
from acquisition.excitation import FourierTrajectory
from acquisition.joint_path import joint_path_motion, joint_table_motion
from acquisition.motion_limits import beyond_limits, refuse, violations
from acquisition.multipoint import multipoint_path
from acquisition.multisine import realisation_motions
from acquisition.path_geometry import stretches
from acquisition.path_motion import path_motion
from acquisition.phase import Phase as Phase
from acquisition.ramp import (
    Path,
    join,
    rest_to_rest,
    rest_to_rest_duration,
    run_in,
    run_out,
    standstill,
)
from config.errors import ConfigError
from config.motion import (
    AnyMotion,
    CircleMotion,
    ConstantVelocityMotion,
    FourierMotion,
    MultipointMotion,
    MultisineMotion,
    ReversedMotion,
)
from config.path_motion import JointPathMotion, JointTableMotion, PathMotion
from config.robot import RobotDescription

LONGEST_MOTION_S = 4 * 3600.0
APPROACH_SPEED_FRACTION = 0.3
RAMP_GROWTH = 1.25
RAMP_ATTEMPTS = 20
DWELL_S = 0.5


@dataclass(frozen=True, eq=False)
class MotionSamples:
    """A motion sampled at the cycle time; it starts and ends at rest.

    Attributes
    ----------
    joint_names : tuple of str
        Base to flange.
    sample_period_s : float
        Time between rows [s].
    position, velocity, acceleration : ndarray, shape (samples, joints)
        rad or m, and per second, per second squared.
    phase : ndarray of uint8, shape (samples,)
        `Phase` of each row.
    samples_per_period : int or None
        Rows of one period where the motion is periodic.
    periods : int
        Whole periods in the rows of `Phase.MAIN`; 0 where the motion is not periodic.
    feedforward : ndarray, shape (samples, joints), or None
        Speeds that the position loop adds to its own, where they are not the motion's: those that
        pre-compensate the drives' velocity loops [rad/s or m/s].
    """

    joint_names: tuple[str, ...]
    sample_period_s: float
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    phase: PhaseArray
    samples_per_period: int | None = None
    periods: int = 0
    feedforward: FloatArray | None = None

    def __post_init__(self) -> None:
        n = len(self.joint_names)
        if not (np.isfinite(self.sample_period_s) and self.sample_period_s > 0.0):
            raise ConfigError(f"motion: sample_period_s must be positive: {self.sample_period_s}")
        position = read_only("motion position", self.position, float, (None, n), ConfigError)
        samples = len(position)
        if samples < 2:
            raise ConfigError(f"motion: {samples} samples are none to stream, 2 are the least")
        shape = (samples, n)
        velocity = read_only("motion velocity", self.velocity, float, shape, ConfigError)
        acceleration = read_only(
            "motion acceleration", self.acceleration, float, shape, ConfigError
        )
        phase = read_only("motion phase", self.phase, np.uint8, (samples,), ConfigError)
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "velocity", velocity)
        object.__setattr__(self, "acceleration", acceleration)
        object.__setattr__(self, "phase", phase)
        if self.feedforward is not None:
            ahead = read_only("motion feedforward", self.feedforward, float, shape, ConfigError)
            object.__setattr__(self, "feedforward", ahead)
        main = int(np.count_nonzero(phase == Phase.MAIN))
        if self.samples_per_period is not None and main != self.periods * self.samples_per_period:
            raise ConfigError(
                f"motion: {main} samples of the main phase are not {self.periods} periods of"
                f" {self.samples_per_period} samples"
            )

    def __len__(self) -> int:
        return len(self.position)

    @property
    def duration_s(self) -> float:
        """Time from the first sample to the last [s]."""
        return (len(self) - 1) * self.sample_period_s


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
            path = multipoint_path(motion, robot, sample_period_s)
        else:
            path, _ = constant_velocity_runs(motion, robot, sample_period_s)
        samples = MotionSamples(
            robot.joint_names, sample_period_s, *path, _phases((Phase.MAIN, len(path.position)))
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
    phase = _phases((Phase.HOLD, rest), (Phase.MAIN, rows - 2 * rest), (Phase.HOLD, rest))
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


def approach(
    from_position: FloatArray,
    to_position: FloatArray,
    robot: RobotDescription,
    sample_period_s: float,
) -> MotionSamples:
    """Return a gentle move from rest to rest, at 30 % of the velocity and acceleration limits.

    Parameters
    ----------
    from_position, to_position : ndarray, shape (joints,)
        Poses [rad or m]: where the robot stands, and where the motion starts.
    robot : RobotDescription
        Joints and limits.
    sample_period_s : float
        The cell's cycle time [s].

    Raises
    ------
    ConfigError
        A pose is outside the position limits.
    """
    n = len(robot.joints)
    start = read_only("pose to start from", from_position, float, (n,), ConfigError)
    end = read_only("pose to go to", to_position, float, (n,), ConfigError)
    velocity_limit = np.array([joint.limits.velocity for joint in robot.joints])
    acceleration_limit = np.array([joint.limits.acceleration for joint in robot.joints])
    duration_s = rest_to_rest_duration(
        end - start,
        APPROACH_SPEED_FRACTION * velocity_limit,
        APPROACH_SPEED_FRACTION * acceleration_limit,
    )
    rows = max(1, math.ceil(duration_s / sample_period_s))
    path = join([rest_to_rest(start, end, rows, sample_period_s), standstill(end, 1)])
    samples = MotionSamples(
        robot.joint_names, sample_period_s, *path, phase=_phases((Phase.APPROACH, rows + 1))
    )
    verify_limits(samples, robot)
    return samples


def verify_limits(
    samples: MotionSamples, robot: RobotDescription, *, oversampling: int = 10
) -> None:
    """Check position, velocity and acceleration between the samples, not only at them.

    The motion is rebuilt as the quintic through each pair of neighbouring rows (their positions,
    velocities and accelerations), so a step in the rows shows up as the speed that it takes.

    Parameters
    ----------
    samples : MotionSamples
        The motion.
    robot : RobotDescription
        The limits.
    oversampling : int
        Points looked at per sample period.

    Raises
    ------
    ConfigError
        A limit is exceeded; the text names every joint, value and limit.
    """
    if samples.joint_names != robot.joint_names:
        raise ConfigError(
            f"the motion is for joints {', '.join(samples.joint_names)}, robot {robot.name!r} has"
            f" {', '.join(robot.joint_names)}"
        )
    path = Path(samples.position, samples.velocity, samples.acceleration)
    refuse(violations(path, robot, samples.sample_period_s, oversampling), "the motion")
    if samples.feedforward is not None:
        fastest = np.abs(samples.feedforward).max(axis=0)
        refuse(
            [
                f"feedforward of joint {joint.name!r} reaches {speed:.4g} per second, its speed"
                f" limit is {joint.limits.velocity:g}"
                for joint, speed in zip(robot.joints, fastest, strict=True)
                if speed > joint.limits.velocity
            ],
            "the feedforward",
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
        phase=_phases(
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
            phases.append(_phases((Phase.HOLD, len(rest.position) + len(way))))
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


def _phases(*counts: tuple[Phase, int]) -> PhaseArray:
    """Return the phase of each row from (phase, rows) pairs."""
    return np.concatenate([np.full(rows, phase, dtype=np.uint8) for phase, rows in counts])
