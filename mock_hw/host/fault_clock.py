"""`CycleCount`: number of cycles since the drives were enabled, counted from frames on the bus."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from config.cell.cell import CellConfig
from config.simulation.faults import FaultScript
from config.simulation.timed_fault import TimedFault
from drivers.canopen.frames import NMT_COB_ID, SYNC_COB_ID
from drivers.servo.cia402 import ControlWord
from drivers.servo.requirements import cyclic_pdos, signal_object

_ENABLING = (ControlWord.ENABLE_OPERATION, ControlWord.ENABLE_INTERPOLATION)


def controlword_places(cell: CellConfig) -> dict[int, int]:
    """Return the first byte of the controlword by the identifier of the RPDO that contains it."""
    places = {}
    for axis in cell.axes:
        profile = cell.servo_of(axis)
        for pdo in cyclic_pdos(axis.node_id, cell.exchange, profile):
            start = 0
            for item in pdo.objects:
                controls = (item.index, item.subindex) == signal_object(profile, "controlword")
                if controls and pdo.direction == "rpdo":
                    places[pdo.cob_id] = start
                start += item.bits // 8
    return places


class CycleCount:
    """Counts SYNC frames from Enable Operation until Disable Voltage or an NMT command.

    Args:
        places: Places of the controlwords, from `controlword_places`.

    Attributes:
        cycle: Number of the present cycle; 0 before the first counted SYNC.
    """

    def __init__(self, places: Mapping[int, int]) -> None:
        self._places = places
        self._enabled = False
        self.cycle = 0

    def observe(self, cob_id: int, data: bytes) -> None:
        """Process a frame of the bus."""
        if cob_id == SYNC_COB_ID:
            self.cycle += self._enabled
        elif (start := self._places.get(cob_id, len(data))) + 2 <= len(data):
            word = int.from_bytes(data[start : start + 2], "little")
            if word in _ENABLING:
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
