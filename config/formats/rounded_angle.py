"""`AngleReading`: an angle as written in a file, and the multiple of 15 degrees that is meant.

Files round right angles to 1.57 or 1.5708. If they are used literally, parallel axes become only
nearly parallel. Parameters that exactly parallel axes make inseparable are then estimated from
noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

STEP_RAD: Final = math.pi / 12.0
NEAR_RAD: Final = 1e-3
ROUNDED_QUARTER_RAD: Final = 5e-3
"""Largest error [rad] of a multiple of a quarter turn with two decimals, such as 3.14 or 4.71."""
EXACT_RAD: Final = 1e-9
NAMED_RAD: Final = 1e-6
"""Smallest correction of an angle that a note reports [rad]."""
FEWEST_DECIMALS: Final = 2

LARGEST_RAD: Final = 1e6
"""Size beyond which an angle is used as it is written [rad]."""


@dataclass(frozen=True)
class AngleReading:
    """An angle as written and as used.

    Attributes:
        written_rad: The value in the file.
        used_rad: The angle that is used: the exact multiple of 15 degrees if the value is a
            rounded one; else the value itself.
        nearest_rad: The nearest multiple of 15 degrees.
    """

    written_rad: float
    used_rad: float
    nearest_rad: float

    @classmethod
    def of(cls, angle_rad: float, exact_rad: float = 0.0) -> AngleReading:
        """Return the reading of an angle.

        The angle is read as the nearest multiple of 15 degrees, except 0, under three conditions.
        It has at least two decimals. It differs from the multiple, or from the multiple rounded to
        single precision, by less than one unit of its last decimal. It differs from the multiple by
        at most 1e-3 rad (quarter turns: 5e-3 rad).

        Args:
            angle_rad: The value in the file.
            exact_rad: An angle that differs from a multiple of a quarter turn by at most this value
                is read as the multiple, even if it has many decimals [rad].
        """
        angle_rad = float(angle_rad)  # numpy's numbers have another shortest text
        if abs(angle_rad) > LARGEST_RAD:
            return cls(angle_rad, angle_rad, angle_rad)
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
        """True if the used value differs from the written one by more than rounding errors."""
        return abs(self.used_rad - self.written_rad) > NAMED_RAD

    @property
    def is_doubtful(self) -> bool:
        """True if the used value is close to a multiple of 15 degrees but not exactly one."""
        return EXACT_RAD < abs(self.used_rad - self.nearest_rad) <= NEAR_RAD


def angle_notes(readings: list[tuple[str, AngleReading]]) -> list[str]:
    """Return notes about angles that were corrected and angles that are doubtful.

    Args:
        readings: The key of each angle, and the angle.
    """
    corrected = [(where, each) for where, each in readings if each.is_corrected]
    doubtful = [(where, each) for where, each in readings if each.is_doubtful]
    notes = []
    if corrected:
        notes.append(
            f"{len(corrected)} rounded angles were read as exact multiples of 15 degrees:"
            f" {_list_angles(corrected)}"
        )
    if doubtful:
        notes.append(
            "angles close to a multiple of 15 degrees, used as written (correct them if they are"
            " meant to be exact; nearly parallel axes degrade the estimate):"
            f" {_list_angles(doubtful)}"
        )
    return notes


def _list_angles(readings: list[tuple[str, AngleReading]], most: int = 6) -> str:
    words = [
        f"{where} {each.written_rad!r} rad ({math.degrees(each.nearest_rad):g} degrees)"
        for where, each in readings[:most]
    ]
    return ", ".join(words) + (f" and {len(readings) - most} more" if readings[most:] else "")


def _decimals(value: float) -> int:
    """Return the number of decimals in the shortest text of a number."""
    mantissa, _, exponent = repr(value).partition("e")
    _, _, decimals = mantissa.partition(".")
    count = 0 if decimals == "0" else len(decimals)
    return count - int(exponent or 0)
