"""`SetPointSource`: where the cyclic task takes its set-points from, one a cycle."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from acquisition.motion.samples import MotionSamples
from acquisition.supervision.cycle import SetPoint
from acquisition.supervision.stop_reason import StopReason
from config.arrays import FloatArray


class SetPointSource(Protocol):
    """A motion that the cyclic task asks for row by row; it is handed to the task's process."""

    @property
    @abstractmethod
    def samples_per_period(self) -> int | None:
        """Rows of one period where the motion is periodic."""

    @property
    @abstractmethod
    def rows_expected(self) -> int:
        """How many rows there may be, to see that there is room to record them."""

    @property
    @abstractmethod
    def period_ends(self) -> Mapping[int, int]:
        """Rows at which so many periods are over; see `period_ends`. Empty if not periodic."""

    @property
    @abstractmethod
    def stop(self) -> StopReason | None:
        """Why the motion was over before its end; None where it came to its end."""

    @property
    @abstractmethod
    def notes(self) -> Sequence[str]:
        """What a person should know once the motion is over, one sentence each."""

    @abstractmethod
    def prepare(self) -> None:
        """Get ready, in the task's process and before the drives are spoken to: may take its time.

        Raises:
            RidDaqError: There is nothing to drive.
        """

    @abstractmethod
    def begin(self, lockstep: bool, position: FloatArray) -> FloatArray:
        """Return the pose to begin at, at rest; called before power, and quick.

        Args:
            lockstep: Whether time stands still while the task works.
            position: Shape (joints,). Where the robot stands [rad or m].
        """

    @abstractmethod
    def watch(self, position: FloatArray, counts: NDArray[np.int32]) -> None:
        """Be told where the robot is: once a cycle, the way to the motion's start included.

        Args:
            position: Shape (joints,). As of the last SYNC [rad or m]; changed in place afterwards.
            counts: Shape (joints,). As the drives sent it; changed in place, too.
        """

    @abstractmethod
    def at(self, row: int) -> SetPoint | None:
        """Return the set-point of a row; None once the motion is over and the robot may rest.

        Rows are asked for in rising order, from 0. One is left out for every cycle that was
        overrun: the answer is the motion's at that time, not what was left out.
        """


@dataclass(frozen=True)
class PlannedMotion:
    """A motion that is known from end to end: the simplest source.

    Attributes:
        samples: The motion.
    """

    samples: MotionSamples

    @property
    def samples_per_period(self) -> int | None:
        """Rows of one period where the motion is periodic."""
        return self.samples.samples_per_period

    @property
    def rows_expected(self) -> int:
        """The motion's rows."""
        return len(self.samples)

    @property
    def period_ends(self) -> Mapping[int, int]:
        """Rows at which so many periods are over."""
        return self.samples.period_ends

    @property
    def stop(self) -> StopReason | None:
        """None: it always comes to its end."""
        return None

    @property
    def notes(self) -> Sequence[str]:
        """Nothing."""
        return ()

    def prepare(self) -> None:
        """Do nothing."""

    def begin(self, lockstep: bool, position: FloatArray) -> FloatArray:
        """Return the first row's pose."""
        return np.asarray(self.samples.position[0])

    def watch(self, position: FloatArray, counts: NDArray[np.int32]) -> None:
        """Do nothing: what is planned does not ask where the robot is."""

    def at(self, row: int) -> SetPoint | None:
        """Return a row of the motion, None after the last."""
        samples = self.samples
        if row >= len(samples):
            return None
        at = samples.place(row)
        velocity = samples.velocity[at].tolist()
        ahead = velocity if samples.feedforward is None else samples.feedforward[at].tolist()
        position = samples.position[at].tolist()
        return SetPoint(position, velocity, ahead, row, int(samples.phase[at]))
