"""`Cycle`: one cycle of the cyclic task, from what it is aimed at to what is commanded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from drivers.interfaces.servo_axes import DriveEvent


class SetPoint(NamedTuple):
    """The set-point of one cycle and where it comes from.

    Attributes:
        position, velocity: Length joints. The motion [rad or m, and per second].
        feedforward: Length joints. Speed that the position loop adds to its own [rad/s or m/s].
        sample_index: Row of the motion, -1 outside it.
        phase: `Phase` of the row.
    """

    position: list[float]
    velocity: list[float]
    feedforward: list[float]
    sample_index: int
    phase: int


@dataclass(slots=True)
class Cycle:
    """What one cycle is aimed at, what was measured in it and what is commanded.

    It is filled on its way: by the exchange with the drives, by `HeldPositions.take` and by the
    position loop; then it is judged, sent and recorded. Lists have one element a joint.

    Attributes:
        number: Cycle times since the first cycle.
        periods: Cycle times since the cycle before, more than 1 after skipped ones.
        lateness_s: How late it began [s].
        target: What it is aimed at.
        time_s, exchange_s: When it began on the bus, on the bus's clock, and how long the answers
            took [s].
        received, enabled, fault: Whose answer came, who follows velocities, and who is in fault.
        position, torque_nm: As measured, link side [rad or m; N m or N].
        position_counts, torque_raw, statusword: As received.
        events: What was made known besides.
        late_frames: Answers that have come too late, so far.
        second_answers: In how many cycles each drive's identifier answered more than once, so far.
        valid: 1 for the joints whose position is plausible, 0 for held values.
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
