"""`SetPointSource`: source of the cyclic task's set-points, one per cycle."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from acquisition.motion.samples import MotionSamples
from acquisition.supervision.cycle import SetPoint
from acquisition.supervision.stop_reason import StopReason
from config.arrays import FloatArray
from drivers.interfaces.servo_axes import Answers


class SetPointSource(Protocol):
    """A motion that the cyclic task reads row by row, in the process of the task."""

    @property
    @abstractmethod
    def samples_per_period(self) -> int | None:
        """Number of rows of one period; None if the motion is not periodic."""

    @property
    @abstractmethod
    def rows_expected(self) -> int:
        """Largest expected number of rows, to check the disk space."""

    @property
    @abstractmethod
    def period_ends(self) -> Mapping[int, int]:
        """Number of complete periods at each row that ends one; empty if not periodic."""

    @property
    @abstractmethod
    def stop(self) -> StopReason | None:
        """Reason for which the motion ended early; None if it reached its end."""

    @property
    @abstractmethod
    def notes(self) -> Sequence[str]:
        """Notes for the user after the motion, one sentence each."""

    @abstractmethod
    def prepare(self) -> None:
        """Prepare the motion in the task's process, before the drives are accessed; may be slow.

        Raises:
            RidDaqError: There is nothing to drive.
        """

    @abstractmethod
    def refuse_begin(self, answers: Answers) -> None:
        """Refuse to begin, before the drives are enabled; must be fast.

        Args:
            answers: The drives' answers to the last SYNC.

        Raises:
            PreflightError: The motion must not begin.
        """

    @abstractmethod
    def begin(self, lockstep: bool, position: FloatArray) -> FloatArray:
        """Return the start pose, at rest; called before the drives are enabled; must be fast.

        Args:
            lockstep: True if simulated time stands still while the task works.
            position: Shape (joints,). Present position of the robot [rad or m].
        """

    @abstractmethod
    def watch(self, answers: Answers) -> None:
        """Receive the drives' answers to the last SYNC, once per cycle, also during the approach.

        Args:
            answers: The answers; the object is reused.
        """

    @abstractmethod
    def at(self, row: int) -> SetPoint | None:
        """Return the set-point of a row; None once the motion is over and the robot may rest.

        Rows are requested in increasing order, from 0. Rows whose cycles were skipped after an
        overrun are not requested. Therefore the set-points stay synchronous with time. If enough
        periods are recorded, the rows of further periods are not requested either.
        """


@dataclass(frozen=True)
class PlannedMotion:
    """Source of set-points from a motion that is completely planned.

    Attributes:
        samples: The motion.
    """

    samples: MotionSamples

    @property
    def samples_per_period(self) -> int | None:
        """Number of rows of one period; None if the motion is not periodic."""
        return self.samples.samples_per_period

    @property
    def rows_expected(self) -> int:
        """Number of rows of the motion."""
        return len(self.samples)

    @property
    def period_ends(self) -> Mapping[int, int]:
        """Number of complete periods at each row that ends one."""
        return self.samples.period_ends

    @property
    def stop(self) -> StopReason | None:
        """None: a planned motion always reaches its end."""
        return None

    @property
    def notes(self) -> Sequence[str]:
        """No notes."""
        return ()

    def prepare(self) -> None:
        """Do nothing."""

    def refuse_begin(self, answers: Answers) -> None:
        """Do nothing: a planned motion may always begin."""

    def begin(self, lockstep: bool, position: FloatArray) -> FloatArray:
        """Return the pose of the first row."""
        return np.asarray(self.samples.position[0])

    def watch(self, answers: Answers) -> None:
        """Do nothing: a planned motion does not depend on the drives' answers."""

    def at(self, row: int) -> SetPoint | None:
        """Return a row of the motion; None after the last row."""
        samples = self.samples
        if row >= len(samples):
            return None
        at = samples.place(row)
        velocity = samples.velocity[at].tolist()
        ahead = velocity if samples.feedforward is None else samples.feedforward[at].tolist()
        position = samples.position[at].tolist()
        return SetPoint(position, velocity, ahead, row, int(samples.phase[at]))
