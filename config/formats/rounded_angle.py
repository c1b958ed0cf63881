"""`AngleReading`: an angle as a person wrote it, and the multiple of 15 degrees that it means.

Files round right angles to 1.57 or 1.5708. Taken literally, parallel axes are nearly parallel, and
parameters that the geometry makes inseparable are estimated from noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

STEP_RAD: Final = math.pi / 12.0
NEAR_RAD: Final = 1e-3
ROUNDED_QUARTER_RAD: Final = 5e-3
"""How far a quarter turn with two decimals is off at most: 3.14, 4.71."""
EXACT_RAD: Final = 1e-9
NAMED_RAD: Final = 1e-6
"""Below this a correction is not worth a note."""
FEWEST_DECIMALS: Final = 2


@dataclass(frozen=True)
class AngleReading:
    """An angle: as written, and as taken.

    Attributes:
        written_rad: What the file says.
        taken_rad: A whole multiple of 15 degrees if the file says that with few digits.
        nearest_rad: The nearest multiple of 15 degrees.
    """

    written_rad: float
    taken_rad: float
    nearest_rad: float

    @classmethod
    def of(cls, angle_rad: float, exact_rad: float = 0.0) -> AngleReading:
        """Read an angle.

        It is taken as a multiple of 15 degrees if it differs from that, or from its value in single
        precision, by less than one unit of its last decimal, and by 1e-3 rad at most (quarter
        turns: 5e-3 rad).

        Args:
            angle_rad: What the file says.
            exact_rad: Quarter turns may differ by this, whatever their decimals.
        """
        nearest = round(angle_rad / STEP_RAD) * STEP_RAD
        error = abs(angle_rad - nearest)
        quarter = round(angle_rad / STEP_RAD) % 6 == 0
        decimals = _decimals(angle_rad)
        last = 10.0**-decimals
        rounded = (
            nearest != 0.0
            and decimals >= FEWEST_DECIMALS
            and min(error, abs(angle_rad - float(np.float32(nearest)))) < last
            and error <= (ROUNDED_QUARTER_RAD if quarter else NEAR_RAD)
        )
        exact = rounded or (quarter and error <= exact_rad)
        return cls(angle_rad, nearest if exact else angle_rad, nearest)

    @property
    def is_corrected(self) -> bool:
        """True if what is taken differs from what is written by more than rounding of doubles."""
        return abs(self.taken_rad - self.written_rad) > NAMED_RAD

    @property
    def is_doubtful(self) -> bool:
        """True if the angle is nearly, and neither exactly nor by rounding, such a multiple."""
        return EXACT_RAD < abs(self.taken_rad - self.nearest_rad) <= NEAR_RAD


def angle_notes(readings: list[tuple[str, AngleReading]]) -> list[str]:
    """Return what to say of angles: which were corrected, and which are doubtful.

    Args:
        readings: Where each angle stands, and the angle.
    """
    corrected = [(where, each) for where, each in readings if each.is_corrected]
    doubtful = [(where, each) for where, each in readings if each.is_doubtful]
    notes = []
    if corrected:
        notes.append(
            f"{len(corrected)} rounded angles were taken as exactly that multiple of 15 degrees:"
            f" {_listed(corrected)}"
        )
    if doubtful:
        notes.append(
            "nearly a multiple of 15 degrees, and taken as written (correct them if they are meant"
            f" to be exact; axes that are nearly parallel spoil the estimate): {_listed(doubtful)}"
        )
    return notes


def _listed(readings: list[tuple[str, AngleReading]], most: int = 6) -> str:
    words = [
        f"{where} {each.written_rad!r} rad ({math.degrees(each.nearest_rad):g} degrees)"
        for where, each in readings[:most]
    ]
    return ", ".join(words) + (f" and {len(readings) - most} more" if readings[most:] else "")


def _decimals(value: float) -> int:
    """Return how many decimals the shortest text of a number has."""
    mantissa, _, exponent = repr(value).partition("e")
    _, _, decimals = mantissa.partition(".")
    count = 0 if decimals == "0" else len(decimals)
    return count - int(exponent or 0)
