"""`CycleCount`: number of cycles since the drives were enabled, counted from frames on the bus."""

from __future__ import annotations

from collections.abc import Iterable

from config.simulation.faults import FaultScript
from config.simulation.timed_fault import TimedFault
from drivers.canopen.frames import NMT_COB_ID, SYNC_COB_ID, rpdo_cob_id
from drivers.servo.cia402 import ControlWord


class CycleCount:
    """Counts SYNC frames from the first Enable Operation until the power is switched off.

    Args:
        node_ids: Node ids of the drives.

    Attributes:
        cycle: Number of the present cycle; 0 before the first counted SYNC.
    """

    def __init__(self, node_ids: Iterable[int]) -> None:
        self._commands = frozenset(rpdo_cob_id(node) for node in node_ids)
        self._enabled = False
        self.cycle = 0

    def observe(self, cob_id: int, data: bytes) -> None:
        """Process a frame of the bus."""
        if cob_id == SYNC_COB_ID:
            self.cycle += self._enabled
        elif cob_id in self._commands and len(data) >= 2:
            word = int.from_bytes(data[:2], "little")
            if word == ControlWord.ENABLE_OPERATION:
                self._enabled = True
            elif word == ControlWord.DISABLE_VOLTAGE:
                self._restart()
        elif cob_id == NMT_COB_ID:
            self._restart()

    def _restart(self) -> None:
        self._enabled = False
        self.cycle = 0


class FaultStart:
    """Start condition of one fault; each fault starts only once.

    Args:
        fault: The fault, with the time or the cycle at which it starts.
        start_s: Time on the bus that corresponds to `at_s` = 0 in the fault script [s].
    """

    def __init__(self, fault: TimedFault, start_s: float) -> None:
        self.at_s = None if fault.at_s is None else start_s + fault.at_s
        self._at_cycle = fault.at_cycle
        self.begun = False

    def starts_now(self, cycle: int, now_s: float) -> bool:
        """Return True, once, when the fault's time or cycle is reached."""
        if self.begun:
            return False
        if self.at_s is not None:
            self.begun = now_s >= self.at_s
        elif self._at_cycle is not None:
            self.begun = cycle >= self._at_cycle
        else:
            self.begun = True
        return self.begun


def refuse_unknown_joints(script: FaultScript, joints: Iterable[str]) -> None:
    """Raise ValueError if a script names a joint that the cell does not have."""
    unknown = sorted(script.joints - set(joints))
    if unknown:
        raise ValueError(f"the fault script names unknown joints: {', '.join(unknown)}")
