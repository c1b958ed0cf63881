"""`MotionSamples`: a motion with one row per cycle, as sent by the cyclic task; and its pieces."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from config.arrays import FloatArray, PhaseArray, freeze
from config.errors import ConfigError


class Phase(IntEnum):
    """Purpose of a row of a motion."""

    APPROACH = 0
    RUN_IN = 1
    TRANSIENT = 2
    MAIN = 3
    RUN_OUT = 4
    HOLD = 5


class JointTrajectory(NamedTuple):
    """Samples of a piece of motion.

    Attributes:
        position, velocity, acceleration: Shape (samples, joints). Position [rad or m], and its
            derivatives per second and per second squared.
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


def standstill(pose: FloatArray, samples: int) -> JointTrajectory:
    """Return `samples` rows at rest in a pose of shape (joints,)."""
    zero = np.zeros((samples, len(pose)))
    return JointTrajectory(position=zero + pose, velocity=zero, acceleration=zero)


def join(pieces: list[JointTrajectory]) -> JointTrajectory:
    """Return the pieces, one after the other, as one piece."""
    return JointTrajectory(*(np.concatenate(arrays) for arrays in zip(*pieces, strict=True)))


@dataclass(frozen=True, eq=False)
class MotionSamples:
    """A motion sampled at the cycle time; it starts and ends at rest.

    A periodic motion may store its main period once. Then `place` returns the index of a row in the
    arrays, and `whole` returns the motion with all rows.

    Attributes:
        joint_names: Joints from base to flange.
        sample_period_s: Time between rows [s].
        position, velocity, acceleration: Shape (samples, joints). Position [rad or m], and its
            derivatives per second and per second squared.
        phase: Shape (samples,). `Phase` of each row.
        samples_per_period: Number of rows per period; None if the motion is not periodic.
        periods: Number of whole periods in `Phase.MAIN`; 0 if the motion is not periodic.
        feedforward: Shape (samples, joints). Speeds that are added to the output of the position
            loop; None for the motion's own velocities. Pre-compensation of the drives' velocity
            loops uses them [rad/s or m/s].
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
            raise ConfigError(
                f"motion: invalid sample_period_s {self.sample_period_s}: give a positive value",
                code="RID-API-ARGUMENT",
            )
        freeze(self, ConfigError, (None, n), "position", what="motion ")
        samples = len(self.position)
        if samples < 2:
            raise ConfigError(
                f"motion: {samples} samples, but at least 2 are needed",
                code="RID-API-ARGUMENT",
            )
        rates = ("velocity", "acceleration", "feedforward")
        freeze(self, ConfigError, (samples, n), *rates, what="motion ")
        freeze(self, ConfigError, (samples,), "phase", what="motion ", dtype=np.uint8)
        main = int(np.count_nonzero(self.phase == Phase.MAIN))
        rows = self.samples_per_period
        if rows is not None and main not in (rows * min(1, self.periods), rows * self.periods):
            raise ConfigError(
                f"motion: {main} samples of the main phase are not {self.periods} periods of"
                f" {rows} samples",
                code="RID-API-ARGUMENT",
            )

    def __len__(self) -> int:
        return len(self.position) + self._repeated_rows

    def place(self, row: int) -> int:
        """Return the array index of a row of the motion."""
        if not self._repeated_rows or row < self._first_main_row:
            return row
        rows = self.samples_per_period or 1
        return row - min((row - self._first_main_row) // rows * rows, self._repeated_rows)

    def whole(self, most_periods: int | None = None) -> MotionSamples:
        """Return the motion with all rows in the arrays.

        Args:
            most_periods: Largest number of periods, if the motion stores only one.
        """
        if not self._repeated_rows:
            return self
        shorter = replace(self, periods=min(self.periods, most_periods or self.periods))
        places = np.array([shorter.place(row) for row in range(len(shorter))])
        held = {name: getattr(self, name) for name in _COLUMNS}
        columns: dict[str, Any] = {
            name: rows[places] for name, rows in held.items() if rows is not None
        }
        return replace(shorter, **columns)

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample [s]."""
        return (len(self) - 1) * self.sample_period_s

    @property
    def period_ends(self) -> dict[int, int]:
        """Number of completed main periods at each row at which one ends.

        All these rows are at the same point of the same path. Therefore the motion can continue
        from each row with the run-out that follows the last period. Empty if the motion is not
        periodic.
        """
        if self.samples_per_period is None:
            return {}
        counts = range(1, self.periods + 1)
        return {self._first_main_row + count * self.samples_per_period: count for count in counts}

    @cached_property
    def _first_main_row(self) -> int:
        return int(np.argmax(self.phase == Phase.MAIN))

    @cached_property
    def _repeated_rows(self) -> int:
        """Number of rows that are not stored, because they repeat an earlier period."""
        driven = self.periods * (self.samples_per_period or 0)
        return driven - int(np.count_nonzero(self.phase == Phase.MAIN)) if driven else 0


_COLUMNS = ("position", "velocity", "acceleration", "phase", "feedforward")


def phases_of(*counts: tuple[Phase, int]) -> PhaseArray:
    """Return the phase of each row from (phase, rows) pairs."""
    return np.concatenate([np.full(rows, phase, dtype=np.uint8) for phase, rows in counts])


def with_rests(
    path: JointTrajectory, dwell_s: float, joint_names: tuple[str, ...], sample_period_s: float
) -> MotionSamples:
    """Return a path with a rest before and after it; the rows in between are its main part.

    Args:
        path: Path from rest to rest.
        dwell_s: Duration of each rest [s], at least one row.
        joint_names: Joints from base to flange.
        sample_period_s: Time between rows [s].
    """
    rest = max(1, math.ceil(dwell_s / sample_period_s))
    before, after = standstill(path.position[0], rest), standstill(path.position[-1], rest)
    phase = phases_of((Phase.HOLD, rest), (Phase.MAIN, len(path.position)), (Phase.HOLD, rest))
    return MotionSamples(joint_names, sample_period_s, *join([before, path, after]), phase)
