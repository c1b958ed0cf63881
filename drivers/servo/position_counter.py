"""`PositionCounter`: range and wrap-around of a drive's position; `PositionTargets`: set-points.

`reference_setting` reports whether a drive is referenced, so that its zero position is known. CiA
402 has no bit for this outside homing mode, so the drive's profile names the manufacturer's bits
(`referenced`). For a drive without such bits, for example with an absolute encoder, the cell file
can state the zero (`position_zero_counts`).

A drive without a velocity mode receives positions: its position at power on, plus the sum of the
commanded velocities times the cycle time. While its power is off, its set-point is its present
position, so that it does not move when its power is switched on.
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
    " and these bits do not apply, set `referenced: null` in the axis's servo profile and state"
    " position_zero_counts"
)
_CORRECT = "correct `referenced` in the axis's servo profile; the drive's manual describes the bits"


@dataclass(frozen=True, slots=True)
class PositionCounter:
    """A position counter whose lowest value follows its highest value, as in a ring.

    Attributes:
        lowest, highest: The limits of 6064h and 607Ah: those in 607Bh (CiA 402-2, position range
            limit), or those of 32-bit numbers.
    """

    lowest: int = _INT32[0]
    highest: int = _INT32[1]

    @classmethod
    def of_limits(cls, lowest: int, highest: int) -> PositionCounter:
        """Return the counter for the limits in 607Bh: 32 bits unless `lowest` is the lower one."""
        return BITS_32 if lowest >= highest else cls(lowest, highest)

    @property
    def size(self) -> int:
        """Number of values of the counter."""
        return self.highest - self.lowest + 1

    @property
    def is_smaller_than_32_bits(self) -> bool:
        """True if the counter has fewer values than a 32-bit number."""
        return (self.lowest, self.highest) != _INT32

    def nearest(self, counts: int, to: int) -> int:
        """Return the unwrapped position nearest to `to` that the drive shows as `counts`."""
        size = self.size
        half = size // 2
        return (counts - to + half) % size - half + to

    def to_range(self, counts: int) -> int:
        """Return the value of the drive, from `lowest` to `highest`, for an unwrapped position."""
        return (counts - self.lowest) % self.size + self.lowest


BITS_32 = PositionCounter()
"""Position counter of a drive without 607Bh."""


def read_counter(port: SdoPort) -> PositionCounter:
    """Return a drive's position counter: the range in 607Bh, or 32 bits if 607Bh cannot be read."""
    try:
        lowest, highest = (port.read_int(POSITION_RANGE, n, signed=True) for n in (1, 2))
    except SdoAbort:
        return BITS_32
    return PositionCounter.of_limits(lowest, highest)


def counter_setting(axis: DriveAxis, counter: PositionCounter, needed: float) -> DriveSetting:
    """Return the check result that compares the counter's range with the axis's position range."""
    return DriveSetting(
        axis.joint,
        axis.node_id,
        object_name(POSITION_RANGE, 0),
        "increments until the position wraps",
        f"> {needed:.0f}, the axis's position range",
        f"{counter.size} ({counter.lowest} to {counter.highest})",
        "ok" if needed < counter.size else "red",
        "widen 607Bh in the drive's own tool, or narrow the position limits in the robot file",
    )


def reference_setting(
    port: SdoPort, axis: DriveAxis, referenced: ReferencedBits | None
) -> DriveSetting:
    """Return the check result that shows whether a drive is referenced.

    Args:
        port: The drive.
        axis: Its axis in the cell file.
        referenced: The bits by which the drive's profile shows this; None if the profile has none.

    Raises:
        DeviceTimeoutError, TransportError: The drive does not answer, or the bus is lost.
    """
    if referenced is None:
        stated = "position_zero_counts" in axis.model_fields_set
        found = (
            "not verified: zero stated in the cell file (position_zero_counts"
            f" {axis.position_zero_counts})"
            if stated
            else "not known"
        )
        return DriveSetting(
            axis.joint,
            axis.node_id,
            object_name(*_POSITION),
            REFERENCED,
            "",
            found,
            "shown",
            headline=REFERENCED,
        )
    address = object_address(referenced.object)
    mask, value = referenced.mask, referenced.referenced_value
    required = f"referenced ({referenced.object} & {mask:X}h = {value:X}h)"
    try:
        held = port.read_int(*address) & referenced.mask
    except SdoAbort as abort:
        missing = "not in this drive" if is_missing(abort) else abort_text(abort.code)
        found, good, advice = missing, False, _CORRECT
    else:
        good = held == referenced.referenced_value
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
        REFERENCED,
    )


class PositionTargets:
    """Set-points of all axes in a cycle; each axis is in a position mode or in a velocity mode.

    Args:
        by_position: True for the axes in a position mode.
        cycle_time_s: Time during which a set-point acts [s].
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
        """Return set-points that cause no motion; an axis without power gets its present position.

        Args:
            counts, enabled: Shape (axes,). Value of 6064h in the last answer, and True if the drive
                is in Operation Enabled.
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
        """Return the set-points for velocities in units of 60FFh (position modes: counts/s)."""
        targets = []
        for axis, (value, by_position) in enumerate(zip(velocity, self._by_position, strict=True)):
            self._targets[axis] += value * self._cycle_time_s
            target = counters[axis].to_range(round(self._targets[axis]))
            targets.append(target if by_position else value)
        return targets
