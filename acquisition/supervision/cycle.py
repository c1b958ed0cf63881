"""`Cycle`: one cycle of the cyclic task, from its set-point to its command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from drivers.interfaces.servo_axes import DriveEvent


class SetPoint(NamedTuple):
    """Set-point of one cycle, with its row.

    Attributes:
        position, velocity: Position and velocity of each joint [rad or m, and per second].
        feedforward: Speed that the position loop adds, one value per joint [rad/s or m/s].
        sample_index: Row of the motion; -1 outside the motion.
        phase: `Phase` of the row.
    """

    position: list[float]
    velocity: list[float]
    feedforward: list[float]
    sample_index: int
    phase: int


@dataclass(slots=True)
class Cycle:
    """Set-point, measurement and command of one cycle.

    The exchange with the drives, `HeldPositions.take` and the position loop fill the fields. Then
    the supervisor checks the cycle, its command is sent, and the cycle is recorded. Lists have one
    element per joint.

    Attributes:
        number: Cycle times since the first cycle.
        periods: Cycle times since the previous cycle; more than 1 after skipped cycles.
        lateness_s: Delay of the beginning of the cycle [s].
        target: Set-point of the cycle.
        time_s, exchange_s: Time of SYNC on the bus's clock, and duration until the last answer [s].
        received, enabled, fault: True for drives that answered, that are enabled, and that are in
            fault.
        position, torque_nm: Measured values, link side [rad or m; N m or N].
        position_counts, torque_raw, statusword: Values as received from the drives.
        events: Other reports of the drives, such as emergency messages.
        late_frames: Number of late answers so far.
        second_answers: Number of cycles so far in which each drive's identifier answered more than
            once.
        valid: 1 for joints with a plausible position, 0 if the last values are held.
        command: Velocity to send [rad/s or m/s].
    """

    number: int
    periods: int
    lateness_s: float
    target: SetPoint
    time_s: float
    exchange_s: float
    received: list[bool]
    enabled: list[bool]
    fault: list[bool]
    position: list[float]
    torque_nm: list[float]
    position_counts: list[int]
    torque_raw: list[int]
    statusword: list[int]
    events: Sequence[DriveEvent]
    late_frames: int
    second_answers: list[int]
    valid: list[int] = field(default_factory=list)
    command: list[float] = field(default_factory=list)
