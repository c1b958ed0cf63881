"""Periodic excitation: one Fourier series per joint, with run-in and run-out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field, model_validator

from acquisition.motion.approach import approach
from acquisition.motion.fourier import FourierTrajectory, samples_of_period
from acquisition.motion.kinds.motion import Motion, Position, Seconds, refuse_longer
from acquisition.motion.limits import beyond_limits, refuse, violations
from acquisition.motion.ramps import run_in, run_out
from acquisition.motion.samples import (
    JointTrajectory,
    MotionSamples,
    Phase,
    join,
    phases_of,
    standstill,
)
from config.arrays import PhaseArray
from config.errors import ConfigError
from config.model import ConfigModel
from config.robot.robot import RobotDescription

RAMP_GROWTH: Final = 1.25
RAMP_ATTEMPTS: Final = 20
MOST_HARMONICS: Final = 1000


class FourierJoint(ConfigModel):
    """Fourier series of one joint (2.30).

    Attributes:
        joint: Name of the joint.
        offset: Position about which the joint moves [rad or m].
        sine: Sine amplitudes of the harmonics, beginning with harmonic 1 [rad or m].
        cosine: Cosine amplitudes of the harmonics, beginning with harmonic 1 [rad or m].
    """

    joint: str
    offset: Position = 0.0
    sine: tuple[Position, ...] = Field(min_length=1, max_length=MOST_HARMONICS)
    cosine: tuple[Position, ...] = Field(min_length=1, max_length=MOST_HARMONICS)

    @model_validator(mode="after")
    def _check_lengths(self) -> FourierJoint:
        if len(self.sine) != len(self.cosine):
            raise ValueError(
                f"sine has {len(self.sine)} harmonics, cosine {len(self.cosine)}: give the same"
                " number"
            )
        return self


class FourierMotion(Motion):
    """Periodic excitation: Fourier series on all joints.

    Attributes:
        period_s: Duration of one period [s].
        periods: Number of periods for the measurement.
        transient_periods: Number of periods before the measurement, in which the transient decays.
        ramp_s: Time to speed up before the first period, and to slow down after the last one [s].
        joints: The Fourier series, one per joint of the robot, in any order.
    """

    kind: Literal["fourier"]
    period_s: Seconds
    periods: Annotated[int, Field(ge=1, le=10_000)] = 16
    transient_periods: Annotated[int, Field(ge=0, le=1000)] = 1
    ramp_s: Seconds = 4.0
    joints: tuple[FourierJoint, ...] = Field(min_length=1)

    def describe(self) -> str:
        """Return a description of the motion in one sentence."""
        harmonics = max(len(joint.sine) for joint in self.joints)
        return (
            f"Fourier motion, {self.periods} period{'s' * (self.periods != 1)} of"
            f" {self.period_s:g} s after"
            f" {self.transient_periods} transient period{'s' * (self.transient_periods != 1)},"
            f" up to harmonic {harmonics}"
            f" ({harmonics / self.period_s:.3g} Hz)."
        )

    def next_command(self, run: Path) -> tuple[object, ...]:
        """Return the command that identifies the robot."""
        return "identify", run

    def trajectory(self, robot: RobotDescription, sample_period_s: float) -> FourierTrajectory:
        """Return the Fourier trajectory, with the joints in the robot's order.

        Args:
            robot: The joints.
            sample_period_s: Time between samples [s].

        Raises:
            ConfigError: A joint of the robot is missing, unknown or named twice, the period is not
                a whole number of samples, or a harmonic is beyond half the sampling frequency.
        """
        given = [joint.joint for joint in self.joints]
        if sorted(given) != sorted(robot.joint_names):
            raise ConfigError(
                f"the motion moves joints {', '.join(given)}, but robot {robot.name!r} needs each"
                f" of {', '.join(robot.joint_names)} once (give amplitude 0 for a joint at rest)",
                code="RID-MOTION-JOINTS",
            )
        by_name = {joint.joint: joint for joint in self.joints}
        joints = [by_name[name] for name in robot.joint_names]
        harmonics = max(len(joint.sine) for joint in joints)
        sine = np.zeros((harmonics, len(joints)))
        cosine = np.zeros((harmonics, len(joints)))
        for column, joint in enumerate(joints):
            sine[: len(joint.sine), column] = joint.sine
            cosine[: len(joint.cosine), column] = joint.cosine
        return FourierTrajectory(
            joint_names=robot.joint_names,
            sample_period_s=sample_period_s,
            samples_per_period=samples_of_period(self.period_s, sample_period_s),
            offset=np.array([joint.offset for joint in joints]),
            sine=sine,
            cosine=cosine,
        )

    def _samples(self, robot: RobotDescription, sample_period_s: float) -> MotionSamples:
        require_duration(self.transient_periods + self.periods, self.period_s, self.ramp_s)
        return periodic_samples(self, robot, sample_period_s)


def require_duration(periods: int, period_s: float, ramp_s: float, parts: int = 1) -> None:
    """Raise an error if periodic motions take longer than permitted.

    Args:
        periods: Number of periods of each part, transient periods included.
        period_s, ramp_s: Durations of a period and of a ramp [s].
        parts: Number of such motions, one after the other.

    Raises:
        ConfigError: The motions are too long.
    """
    seconds = parts * (periods * period_s + 2 * ramp_s)
    refuse_longer(seconds, f"{parts * periods} periods of {period_s:.6g} s, and ramps")


def periodic_samples(
    motion: FourierMotion, robot: RobotDescription, sample_period_s: float
) -> MotionSamples:
    """Return a periodic motion with run-in and run-out along its own path.

    The rows of the main phase are one period, which is repeated. The ramps are longer than `ramp_s`
    if the limits require it.

    Args:
        motion: The periodic motion.
        robot: Joints and limits.
        sample_period_s: Cycle time of the cell [s].

    Raises:
        ConfigError: See `FourierMotion.trajectory`; or the period or its ramps exceed a limit.
    """
    trajectory = motion.trajectory(robot, sample_period_s)
    times_s = trajectory.sample_times_s
    period = JointTrajectory(
        trajectory.position(times_s),
        trajectory.velocity(times_s),
        trajectory.acceleration(times_s),
    )
    first_row = JointTrajectory(*(values[:1] for values in period))
    refuse(violations(join([period, first_row]), robot, sample_period_s), "the periodic motion")
    start, end = _ramps(trajectory, motion.ramp_s, robot)
    path = join([start, *[period] * (motion.transient_periods + 1), end])
    return MotionSamples(
        robot.joint_names,
        sample_period_s,
        *path,
        phase=phases_of(
            (Phase.RUN_IN, len(start.position)),
            (Phase.TRANSIENT, motion.transient_periods * trajectory.samples_per_period),
            (Phase.MAIN, trajectory.samples_per_period),
            (Phase.RUN_OUT, len(end.position)),
        ),
        samples_per_period=trajectory.samples_per_period,
        periods=motion.periods,
    )


def join_periodic_motions(
    parts: Sequence[FourierMotion],
    robot: RobotDescription,
    sample_period_s: float,
    dwell_s: float,
) -> MotionSamples:
    """Return several periodic motions, one after the other; the sequence is not periodic.

    Args:
        parts: The motions.
        robot: Joints and limits.
        sample_period_s: Cycle time of the cell [s].
        dwell_s: Rest between two motions, before the move to the next one [s].

    Raises:
        ConfigError: See `periodic_samples`.
    """
    planned = [periodic_samples(part, robot, sample_period_s).whole() for part in parts]
    paths: list[JointTrajectory] = []
    phases: list[PhaseArray] = []
    for number, part in enumerate(planned):
        if number > 0:
            last = planned[number - 1].position[-1]
            rest = standstill(last, max(1, math.ceil(dwell_s / sample_period_s)))
            way = approach(last, part.position[0], robot, sample_period_s)
            paths += [rest, JointTrajectory(way.position, way.velocity, way.acceleration)]
            phases.append(phases_of((Phase.HOLD, len(rest.position) + len(way))))
        paths.append(JointTrajectory(part.position, part.velocity, part.acceleration))
        phases.append(part.phase)
    return MotionSamples(robot.joint_names, sample_period_s, *join(paths), np.concatenate(phases))


def _ramps(
    trajectory: FourierTrajectory, ramp_s: float, robot: RobotDescription
) -> tuple[JointTrajectory, JointTrajectory]:
    """Return run-in and run-out with the requested duration, or longer if the limits require it."""
    sample_period_s = trajectory.sample_period_s
    rows = max(2, math.ceil(ramp_s / sample_period_s - 1e-6))
    broken: list[str] = []
    for _ in range(RAMP_ATTEMPTS):
        start, end = run_in(trajectory, rows), run_out(trajectory, rows)
        joined = join([start, JointTrajectory(*(values[:1] for values in end))])
        broken = [
            *violations(joined, robot, sample_period_s),
            *violations(end, robot, sample_period_s),
        ]
        if not broken:
            return start, end
        rows = math.ceil(rows * RAMP_GROWTH)
    raise beyond_limits(broken, f"a ramp of {ramp_s:g} s, like every longer ramp that was tried,")
