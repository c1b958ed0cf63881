"""`MotionSamples`: a motion as the cyclic task streams it, one row a cycle, verified."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acquisition.motion.limits import refuse, violations
from acquisition.motion.phase import Phase as Phase
from acquisition.motion.ramps import Path
from config.arrays import FloatArray, PhaseArray, read_only
from config.errors import ConfigError
from config.robot.robot import RobotDescription


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


def phases_of(*counts: tuple[Phase, int]) -> PhaseArray:
    """Return the phase of each row from (phase, rows) pairs."""
    return np.concatenate([np.full(rows, phase, dtype=np.uint8) for phase, rows in counts])
