"""`LoadTransfer`: a simulated robot takes up or puts down a payload during a motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from mock_hw.plant.snapshot import SnapshotReader

BOUNCE_STEP_S: Final = 0.008
"""Time after which the contact of a bouncing switch opens or closes again [s]."""


@dataclass(frozen=True)
class GripperSwitch:
    """Switch of a gripper, at a digital input of a drive.

    Attributes:
        joint: Joint whose drive has the input.
        bit: Bit of 60FDh.
        level: Level of the bit after the switch has been actuated.
        delay_s: Time from the beginning of the load transfer until the switch is actuated [s].
        bounce_s: Time for which the contact then opens and closes in turn [s].
        stuck: True if the switch is actuated from the beginning.
    """

    joint: str
    bit: int
    level: bool
    delay_s: float = 0.0
    bounce_s: float = 0.0
    stuck: bool = False

    def level_at(self, after_s: float) -> bool | None:
        """Return the level at a time after the transfer's start; None before it is actuated."""
        if self.stuck:
            return self.level
        since_s = after_s - self.delay_s
        if since_s < 0.0:
            return None
        opened = since_s < self.bounce_s and int(since_s / BOUNCE_STEP_S) % 2 == 1
        return self.level != opened


@dataclass(frozen=True)
class LoadTransfer:
    """A change of the payload over a time, in which mass and inertia change linearly.

    The payload moves with the flange already, so that no impact occurs.

    Attributes:
        payload: Name of the payload after the transfer; None for an empty flange.
        begin_s: Beginning, from the SYNC of the motion's first row [s].
        duration_s: Load-transfer time [s].
        switch: Switch that reports the transfer; None without a switch.
        missed: True if the gripper does not close: the payload does not change, and the switch is
            not actuated.
    """

    payload: str | None
    begin_s: float
    duration_s: float
    switch: GripperSwitch | None = None
    missed: bool = False


class DigitalInputs:
    """Digital inputs of all drives, to which the switches of a gripper are connected.

    Before the first transfer, each input has the level opposite to that of its first switch.

    Args:
        transfers: Changes of the payload during a motion.
        joints: Names of the joints, in the order of the drives.
    """

    def __init__(self, transfers: tuple[LoadTransfer, ...], joints: tuple[str, ...]) -> None:
        self._joints = joints
        self._transfers = [each for each in transfers if each.switch is not None]
        self._origin_s = math.inf

    def begin(self, origin_s: float) -> None:
        """Begin a motion, whose first row is at `origin_s` [s]."""
        self._origin_s = origin_s

    def words(self, time_s: float) -> list[int]:
        """Return 60FDh of every drive at a time [s]."""
        levels: dict[tuple[str, int], bool] = {}
        for transfer in self._transfers:
            switch = transfer.switch
            assert switch is not None
            after_s = time_s - self._origin_s - transfer.begin_s
            level = None if transfer.missed else switch.level_at(after_s)
            if level is not None:
                levels[switch.joint, switch.bit] = level
            else:
                levels.setdefault((switch.joint, switch.bit), not switch.level)
        return [
            sum(1 << bit for (own, bit), level in levels.items() if level and own == joint)
            for joint in self._joints
        ]


class MotionMarker:
    """Tells the simulation when a motion begins; usable in the process of the cyclic task.

    Args:
        path: File with the true state of the axes.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._snapshots: SnapshotReader | None = None

    def open(self) -> None:
        """Open the file, before the motion.

        Raises:
            TransportError: The simulation does not run.
        """
        self._snapshots = SnapshotReader(self._path)

    def mark(self, row: int) -> None:
        """Announce that the next SYNC belongs to a row of the motion."""
        assert self._snapshots is not None
        self._snapshots.announce_row(row)
