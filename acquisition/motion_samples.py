"""`MotionSamples`: a motion as the cyclic task streams it, one row a cycle, verified."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from acquisition.arrays import FloatArray, PhaseArray, read_only
from config.errors import ConfigError


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
