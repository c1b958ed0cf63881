"""`PositionCounter`: range and wrap-around of a drive's position; `PositionTargets` uses it.

`reference_setting` reports whether the drive's zero is known. CiA 402 has no bit for that outside
homing mode, so the drive's profile names the manufacturer's bits (`referenced`). For a drive
without such bits, for example with an absolute encoder, the cell file can state the zero
(`position_zero_counts`).

A drive without a velocity mode receives positions: the sum of the commanded velocities over the
cycles, starting at the axis's position at power on. While its power is off, its set-point is its
present position, so that power on moves nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.cell.cell import DriveAxis
from config.cell.fixed_pdo import object_address
from config.cell.servo_profile import ReferencedBits
from drivers.canopen.sdo import SdoAbort, abort_text, object_name
from drivers.interfaces.servo_axes import DriveSetting
from drivers.servo.sdo_port import SdoPort, is_missing

POSITION_RANGE = 0x607B
_INT32 = (-(1 << 31), (1 << 31) - 1)

REFERENCED: Final = "position reference"
NOT_REFERENCED: Final = "RID-DRIVE-NOT-REFERENCED"

_POSITION: Final = (0x6064, 0)
_HOME = (
    "home the drive with its own tool, then run `rid-daq check` again; if its encoder is absolute"
    " and the bits do not apply, set `referenced: null` in the axis's servo and state"
    " position_zero_counts"
)
_CORRECT = "correct `referenced` in the axis's servo by the drive's manual"


@dataclass(frozen=True, slots=True)
class PositionCounter:
    """A counter that wraps from its highest value to its lowest, and back.

    Attributes:
        lowest, highest: The values between which 6064h and 607Ah count: those of 607Bh (CiA 402-2,
            position range limit), or of 32 bits.
    """

    lowest: int = _INT32[0]
    highest: int = _INT32[1]

    @classmethod
    def of_limits(cls, lowest: int, highest: int) -> PositionCounter:
        """Return the counter for a drive's 607Bh; equal limits mean no limit."""
        return BITS_32 if lowest >= highest else cls(lowest, highest)

    @property
    def size(self) -> int:
        """Number of its values."""
        return self.highest - self.lowest + 1

    @property
    def is_smaller_than_32_bits(self) -> bool:
        """True if it has fewer values than 32 bits."""
        return (self.lowest, self.highest) != _INT32

    def nearest(self, counts: int, to: int) -> int:
        """Return the count, plus whole ranges of the counter, that is nearest to another."""
        half = self.size // 2
        return (counts - to + half) % self.size - half + to

    def to_range(self, counts: int) -> int:
        """Return a count in the drive's range, for reports and set-points."""
        return (counts - self.lowest) % self.size + self.lowest


BITS_32 = PositionCounter()
"""The counter of a drive without 607Bh."""


def read_counter(port: SdoPort) -> PositionCounter:
    """Return the range of a drive's position: 607Bh, or 32 bits if that cannot be read."""
    try:
        lowest, highest = (port.read_int(POSITION_RANGE, n, signed=True) for n in (1, 2))
    except SdoAbort:
        return BITS_32
    return PositionCounter.of_limits(lowest, highest)


def counter_setting(axis: DriveAxis, counter: PositionCounter, needed: float) -> DriveSetting:
    """Return the setting that compares a counter's range with the axis's range."""
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


def reference_setting(
    port: SdoPort, axis: DriveAxis, referenced: ReferencedBits | None
) -> DriveSetting:
    """Return the setting that shows whether a drive is referenced.

    Args:
        port: The drive.
        axis: Its axis in the cell file.
        referenced: The bits of its profile for that; None if it has none.

    Raises:
        DeviceTimeoutError, TransportError: The drive does not answer, or the bus is lost.
    """
    if referenced is None:
        stated = "position_zero_counts" in axis.model_fields_set
        found = (
            f"zero stated in the cell file (position_zero_counts {axis.position_zero_counts})"
            if stated
            else "not known"
        )
        return DriveSetting(
            axis.joint, axis.node_id, object_name(*_POSITION), REFERENCED, "", found, "shown"
        )
    address = object_address(referenced.object)
    required = f"referenced ({referenced.object} & {referenced.mask:X}h = {referenced.wanted:X}h)"
    try:
        held = port.read_int(*address) & referenced.mask
    except SdoAbort as abort:
        missing = "not in this drive" if is_missing(abort) else abort_text(abort.code)
        found, good, advice = missing, False, _CORRECT
    else:
        good = held == referenced.wanted
        found = f"{'referenced' if good else 'not referenced'}, by the drive ({held:X}h)"
        advice = _HOME
    return DriveSetting(
        axis.joint,
        axis.node_id,
        referenced.object,
        REFERENCED,
        required,
        found,
        "ok" if good else "red",
        "" if good else advice,
        "" if good else NOT_REFERENCED,
    )


class PositionTargets:
    """Set-points of the axes in a cycle, for position and velocity modes together.

    Args:
        by_position: Which axes are in a position mode.
        cycle_time_s: Time for which a set-point acts [s].
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
        """Return the set-points at rest; an axis without power gets its present position.

        Args:
            counts, enabled: Shape (axes,). 6064h of the last answers, and whether the drive is in
                Operation Enabled.
            counters: The drives' counters, one per axis.
        """
        for axis, (at, powered) in enumerate(zip(counts.tolist(), enabled.tolist(), strict=True)):
            if not powered:
                self._targets[axis] = float(at)
        return [
            counter.to_range(round(target)) if by_position else 0
            for target, by_position, counter in zip(
                self._targets, self._by_position, counters, strict=True
            )
        ]

    def follow(self, velocity: Sequence[int], counters: Sequence[PositionCounter]) -> list[int]:
        """Return the set-points for velocities in 60FFh's units (here: counts/s)."""
        targets = []
        for axis, (value, by_position) in enumerate(zip(velocity, self._by_position, strict=True)):
            self._targets[axis] += value * self._cycle_time_s
            target = counters[axis].to_range(round(self._targets[axis]))
            targets.append(target if by_position else value)
        return targets
