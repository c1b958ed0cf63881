"""`Phase`: what part of a motion a row belongs to."""

from __future__ import annotations

from enum import IntEnum


class Phase(IntEnum):
    """What a sample of a motion is for."""

    APPROACH = 0
    RUN_IN = 1
    TRANSIENT = 2
    MAIN = 3
    RUN_OUT = 4
    HOLD = 5
