"""`MotionSamples`: a motion as the cyclic task streams it, one row a cycle, verified."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from acquisition.arrays import FloatArray, PhaseArray, read_only
from acquisition.constant_velocity import constant_velocity_runs, duration_s
from acquisition.excitation import FourierTrajectory
from acquisition.multipoint import multipoint_path
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
    ConstantVelocityMotion,
    FourierMotion,
    MultipointMotion,
    ReversedMotion,
)
from config.robot import RobotDescription
from drivers.wrist_coupling import WristCoupling

LONGEST_MOTION_S = 4 * 3600.0
APPROACH_SPEED_FRACTION = 0.3
RAMP_GROWTH = 1.25
RAMP_ATTEMPTS = 20
CHUNK_ROWS = 10_000


class Phase(IntEnum):
    """What a sample of a motion is for."""

    APPROACH = 0
    RUN_IN = 1
    TRANSIENT = 2
    MAIN = 3
    RUN_OUT = 4
    HOLD = 5


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
    """

    joint_names: tuple[str, ...]
    sample_period_s: float
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    phase: PhaseArray
    samples_per_period: int | None = None
    periods: int = 0

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
    motion : FourierMotion, MultipointMotion, ConstantVelocityMotion or ReversedMotion
        What the robot is to do. A reversed motion is planned as two periodic ones, and counts as
        not periodic as a whole.
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
    elif isinstance(motion, ReversedMotion):
        samples = _plan_reversed(motion, robot, sample_period_s)
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


def _refuse_endless(motion: AnyMotion) -> None:
    if isinstance(motion, MultipointMotion):
        return
    if isinstance(motion, ConstantVelocityMotion):
        seconds, what = duration_s(motion), "its runs"
    else:
        periods = motion.transient_periods + motion.periods
        parts = 2 if isinstance(motion, ReversedMotion) else 1
        seconds = parts * (periods * motion.period_s + 2 * motion.ramp_s)
        what = f"{parts * periods} periods of {motion.period_s:.6g} s and its ramps"
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
    _refuse(_violations(path, robot, samples.sample_period_s, oversampling), "the motion")


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
    _refuse(_violations(join([period, first_row]), robot, sample_period_s), "the periodic motion")
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


def _plan_reversed(
    motion: ReversedMotion, robot: RobotDescription, sample_period_s: float
) -> MotionSamples:
    """Return the motion, a rest, and the motion backwards, which starts where that one ends."""
    there = _plan_fourier(motion.there(), robot, sample_period_s)
    back = _plan_fourier(motion.back(), robot, sample_period_s)
    rest = standstill(there.position[-1], max(1, math.ceil(motion.dwell_s / sample_period_s)))
    pieces = [Path(x.position, x.velocity, x.acceleration) for x in (there, back)]
    path = join([pieces[0], rest, pieces[1]])
    hold = _phases((Phase.HOLD, len(rest.position)))
    phase = np.concatenate([there.phase, hold, back.phase])
    return MotionSamples(robot.joint_names, sample_period_s, *path, phase)


def _ramps(
    trajectory: FourierTrajectory, ramp_s: float, robot: RobotDescription
) -> tuple[Path, Path]:
    """Return run-in and run-out, as long as asked for or as much longer as the limits need."""
    sample_period_s = trajectory.sample_period_s
    rows = max(2, math.ceil(ramp_s / sample_period_s - 1e-6))
    violations: list[str] = []
    for _ in range(RAMP_ATTEMPTS):
        start, end = run_in(trajectory, rows), run_out(trajectory, rows)
        joined = join([start, Path(*(values[:1] for values in end))])
        violations = [
            *_violations(joined, robot, sample_period_s),
            *_violations(end, robot, sample_period_s),
        ]
        if not violations:
            return start, end
        rows = math.ceil(rows * RAMP_GROWTH)
    raise _beyond_limits(violations, f"a ramp of {ramp_s:g} s, and any longer one tried,")


def _phases(*counts: tuple[Phase, int]) -> PhaseArray:
    """Return the phase of each row from (phase, rows) pairs."""
    return np.concatenate([np.full(rows, phase, dtype=np.uint8) for phase, rows in counts])


def _violations(
    path: Path, robot: RobotDescription, sample_period_s: float, oversampling: int = 10
) -> list[str]:
    """Return what exceeds which limit, in words: the worst of each joint, quantity and side."""
    limits = [joint.limits for joint in robot.joints]
    velocity = ("/s", [-x.velocity for x in limits], [x.velocity for x in limits])
    bounds = [
        ("position", "", [x.position_min for x in limits], [x.position_max for x in limits]),
        ("velocity", *velocity),
        (
            "acceleration",
            "/s^2",
            [-x.acceleration for x in limits],
            [x.acceleration for x in limits],
        ),
    ]
    coupling = WristCoupling.of_robot(robot)
    if coupling is not None:
        bounds.append(("velocity of the motor", *velocity))
    worst: dict[tuple[str, int, float], tuple[float, str]] = {}
    for first in range(0, len(path.position) - 1, CHUNK_ROWS):
        chunk = Path(*(values[first : first + CHUNK_ROWS + 1] for values in path))
        fine: tuple[FloatArray, ...] = _between_rows(chunk, sample_period_s, oversampling)
        if coupling is not None:
            fine = (*fine, coupling.to_motors(fine[1]))
        for values, (quantity, per, low, high) in zip(fine, bounds, strict=True):
            for side, limit in ((1.0, high), (-1.0, low)):
                excess = side * (values - limit)
                rows = excess.argmax(axis=0)
                for column, (joint, row) in enumerate(zip(robot.joints, rows, strict=True)):
                    by = float(excess[row, column])
                    key = (quantity, column, side)
                    if by <= 1e-9 * abs(limit[column]) or by <= worst.get(key, (0.0, ""))[0]:
                        continue
                    unit = ("rad" if joint.type == "revolute" else "m") + per
                    time_s = (first + row / oversampling) * sample_period_s
                    worst[key] = (
                        by,
                        f"{quantity} of joint {joint.name!r} reaches"
                        f" {values[row, column]:.6g} {unit} at {time_s:.4g} s, its limit is"
                        f" {limit[column]:.6g}",
                    )
    return [words for _, words in worst.values()]


def _between_rows(path: Path, sample_period_s: float, oversampling: int) -> Path:
    """Return the quintic through the rows at `oversampling` points per sample period."""
    h = sample_period_s
    q0, v0, a0 = path.position[:-1], h * path.velocity[:-1], h**2 * path.acceleration[:-1]
    q1, v1, a1 = path.position[1:], h * path.velocity[1:], h**2 * path.acceleration[1:]
    rest = q1 - q0 - v0 - a0 / 2.0
    slope = v1 - v0 - a0
    bend = a1 - a0
    c3 = 10.0 * rest - 4.0 * slope + bend / 2.0
    c4 = -15.0 * rest + 7.0 * slope - bend
    c5 = 6.0 * rest - 3.0 * slope + bend / 2.0
    x = (np.arange(oversampling) / oversampling)[:, np.newaxis]

    def rows(inner: FloatArray, last: FloatArray) -> FloatArray:
        return np.concatenate([inner.reshape(-1, last.shape[-1]), last[-1:]])

    q0, v0, a0, c3, c4, c5 = (values[:, np.newaxis, :] for values in (q0, v0, a0, c3, c4, c5))
    position = q0 + x * (v0 + x * (a0 / 2.0 + x * (c3 + x * (c4 + x * c5))))
    velocity = v0 + x * (a0 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))
    acceleration = a0 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5))
    return Path(
        rows(position, path.position),
        rows(velocity / h, path.velocity),
        rows(acceleration / h**2, path.acceleration),
    )


def _beyond_limits(violations: list[str], what: str) -> ConfigError:
    return ConfigError(
        f"{what} exceeds the robot's limits: {'; '.join(violations)}. Reduce the amplitudes or"
        " speeds, or correct the limits in the robot file"
    )


def _refuse(violations: list[str], what: str) -> None:
    if violations:
        raise _beyond_limits(violations, what)
