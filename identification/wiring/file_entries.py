"""`UnconfirmedEntry`: entries of the files that recordings do not confirm."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

SCALE_ERROR: Final = 0.2
"""An entry for lengths or torques is confirmed if the data reveal a relative error of this size."""
ZERO_ERROR_DEG: Final = 5.0
POSITION_FACTOR: Final = 2.0


class EntryKind(StrEnum):
    """Kind of an entry of the files."""

    LENGTHS = "lengths"
    TWISTS = "twists"
    DIRECTION = "direction"
    ZERO_POSITION = "zero position"
    POSITION_SCALE = "position scale"
    TORQUE_SCALE = "torque scale"
    COMMON_TORQUE_SCALE = "common torque scale"


@dataclass(frozen=True)
class UnconfirmedEntry:
    """Entries of one kind whose mistakes would not be noticed.

    Attributes:
        kind: Kind of the entries.
        numbers: Joints, or rows of the kinematic table, from 0; empty for the whole robot.
    """

    kind: EntryKind
    numbers: tuple[int, ...]
