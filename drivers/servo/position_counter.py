"""`PositionCounter`: how a drive's position counts and wraps; `PositionTargets`, counted so.

A drive without a velocity mode gets the sum of its velocities, from where its axis was when it was
switched on. While it is not, its set-point is where it stands: power moves nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.cell.cell import DriveAxis
from drivers.canopen.sdo import SdoAbort, object_name
from drivers.interfaces.servo_axes import DriveSetting
from drivers.servo.sdo_port import SdoPort

POSITION_RANGE = 0x607B
_INT32 = (-(1 << 31), (1 << 31) - 1)


@dataclass(frozen=True, slots=True)
class PositionCounter:
    """A counter that goes from its highest value to its lowest, and back.

    Attributes
    ----------
    lowest, highest : int
        The values between which 6064h and 607Ah count: those of 607Bh (CiA 402-2, position range
        limit), or of 32 bits.
    """

    lowest: int = _INT32[0]
    highest: int = _INT32[1]

    @classmethod
    def of_limits(cls, lowest: int, highest: int) -> PositionCounter:
        """Return the counter of a drive's 607Bh; equal limits stand for no limit."""
        return BITS_32 if lowest >= highest else cls(lowest, highest)

    @property
    def size(self) -> int:
        """How many values it has."""
        return self.highest - self.lowest + 1

    @property
    def wraps_early(self) -> bool:
        """Whether it has fewer values than 32 bits."""
        return (self.lowest, self.highest) != _INT32

    def nearest(self, counts: int, to: int) -> int:
        """Return the count, whole rounds of the counter added, that is nearest to another."""
        half = self.size // 2
        return (counts - to + half) % self.size - half + to

    def shown(self, counts: int) -> int:
        """Return a count as the drive shows it, and takes it as a set-point."""
        return (counts - self.lowest) % self.size + self.lowest


BITS_32 = PositionCounter()
"""The counter of a drive without 607Bh."""


def read_counter(port: SdoPort) -> PositionCounter:
    """Return how a drive's position wraps: by 607Bh, or by 32 bits if it cannot be read."""
    try:
        lowest, highest = (port.read_int(POSITION_RANGE, n, signed=True) for n in (1, 2))
    except SdoAbort:
        return BITS_32
    return PositionCounter.of_limits(lowest, highest)


def counter_setting(axis: DriveAxis, counter: PositionCounter, needed: float) -> DriveSetting:
    """Return the line that compares a counter with the increments of the axis's whole reach."""
    return DriveSetting(
        axis.joint,
        axis.node_id,
        object_name(POSITION_RANGE, 0),
        "increments until the position wraps",
        f"> {needed:.0f}, the axis's whole reach",
        f"{counter.size} ({counter.lowest} to {counter.highest})",
        "ok" if needed < counter.size else "red",
        "widen 607Bh in the drive's own tool, or narrow the position limits in the robot file",
    )


class PositionTargets:
    """What the axes are told in a cycle, those by position and those by velocity together.

    Parameters
    ----------
    by_position : sequence of bool
        Which axes follow positions.
    cycle_time_s : float
        How long a set-point acts [s].
    """

    def __init__(self, by_position: Sequence[bool], cycle_time_s: float) -> None:
        self._by_position = tuple(by_position)
        self._cycle_time_s = cycle_time_s
        self._targets = [0.0] * len(self._by_position)

    def hold(
        self,
        counts: NDArray[np.int32],
        enabled: NDArray[np.bool_],
        counters: Sequence[PositionCounter],
    ) -> list[int]:
        """Return the set-points at rest: of an axis without power where it stands.

        Parameters
        ----------
        counts, enabled : ndarray, shape (axes,)
            6064h of the last answers, and whether the drive is in Operation Enabled.
        counters : sequence of PositionCounter
            How the drives count, one an axis.
        """
        for axis, (at, powered) in enumerate(zip(counts.tolist(), enabled.tolist(), strict=True)):
            if not powered:
                self._targets[axis] = float(at)
        return [
            counter.shown(round(target)) if by_position else 0
            for target, by_position, counter in zip(
                self._targets, self._by_position, counters, strict=True
            )
        ]

    def follow(self, velocity: Sequence[int], counters: Sequence[PositionCounter]) -> list[int]:
        """Return the set-points that velocities lead to, in 60FFh's units (here: counts/s)."""
        told = []
        for axis, (value, by_position) in enumerate(zip(velocity, self._by_position, strict=True)):
            self._targets[axis] += value * self._cycle_time_s
            target = counters[axis].shown(round(self._targets[axis]))
            told.append(target if by_position else value)
        return told
