"""`StopReason`: reason of a stop, for people and for programs."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class StopCode(IntEnum):
    """Kind of stop (docs/faults.md lists the faults)."""

    INTERRUPTED = 1
    MISSED_FRAMES = 2
    LATE_FRAMES = 3
    IMPLAUSIBLE_POSITION = 4
    DRIVE_RESTARTED = 5
    EMERGENCY = 6
    HEARTBEAT_LOST = 7
    DRIVE_FAULT = 8
    NOT_ENABLED = 9
    FOLLOWING_ERROR = 10
    POSITION_LIMIT = 11
    VELOCITY_LIMIT = 12
    TORQUE_LIMIT = 13
    SET_POINT = 14
    STUCK_ENCODER = 15
    LATE_CYCLE = 16
    RECORDER = 17
    PROGRAM_GONE = 18
    BUS = 19
    TASK_DIED = 20
    PLATE_LINE = 21
    PLATE_OVERLOAD = 22
    STOP_COMMAND = 23
    STOP_BUTTON = 24
    CLIENT_LOST = 25
    SERVICE_LOST = 26
    POINTS_LOST = 31
    POINTS_REFUSED = 32
    SECOND_ANSWERS = 33
    LOAD_SIGNAL = 34


@dataclass(frozen=True)
class StopReason:
    """Reason of a stop.

    Attributes:
        code: Kind of the stop.
        text: One sentence for people, with joint, value, limit and what to check.
        joint: The joint concerned.
        value, limit: Measured value and limit, in the unit of `text`.
    """

    code: StopCode
    text: str
    joint: str | None = None
    value: float | None = None
    limit: float | None = None
