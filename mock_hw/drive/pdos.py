"""PDOs of a simulated drive, as configured in its objects (CiA 301, 7.5.2.33 to 7.5.2.38)."""

from __future__ import annotations

import math
import struct

from drivers.canopen.frames import Frame
from drivers.canopen.pdo import (
    RPDO_COMMUNICATION,
    RPDO_MAPPING,
    TPDO_COMMUNICATION,
    TPDO_MAPPING,
    MappedObject,
    is_valid,
)
from drivers.canopen.sdo import SdoAbort, SdoCode
from mock_hw.drive.object_dictionary import Key, ObjectDictionary
from mock_hw.drive.objects import ON_REQUEST, PDO_NUMBERS
from mock_hw.drive.power_stage import DriveClock

SYNCHRONOUS_TYPES = range(241)

_COB_ID_MASK = 0x7FF
_EXTENDED = 0x2000_0000
_FAMILY_MASK = 0xFE00


class DrivePdo:
    """One valid PDO: its identifier, transmission type and mapped objects.

    Attributes:
        receives: True for an RPDO.
        cob_id: CAN identifier of the PDO.
        synchronous: True if SYNC triggers the transmission, or the effect, of the PDO.
        keys: Mapped objects.
        layout: Layout of the mapped objects in the data bytes.
        kept: Received values of a synchronous RPDO, which take effect at the next SYNC.
        deadline_s: For an RPDO: time at which the next frame is overdue [s]; infinity before the
            first frame. For a TPDO: time at which it is sent because of its event timer or a change
            [s].
    """

    def __init__(
        self,
        objects: ObjectDictionary,
        clock: DriveClock,
        family: int,
        number: int,
        now_s: float,
    ) -> None:
        self._clock = clock
        communication = family + number - 1
        mapping = communication + RPDO_MAPPING - RPDO_COMMUNICATION
        self.receives = family == RPDO_COMMUNICATION
        self.cob_id = objects[communication, 1] & _COB_ID_MASK
        self._type = objects[communication, 2]
        self.synchronous = self._type in SYNCHRONOUS_TYPES
        mapped = [
            MappedObject.parse(objects[mapping, position])
            for position in range(1, objects[mapping, 0] + 1)
        ]
        self.keys: tuple[Key, ...] = tuple((item.index, item.subindex) for item in mapped)
        self.layout = struct.Struct("<" + "".join(objects.entry(*key).code for key in self.keys))
        self._inhibit_s = 0.0 if self.receives else objects[communication, 3] * 1e-4
        self._event_s = objects[communication, 5] * 1e-3
        self._last_s = -math.inf
        self._syncs = 0
        self.last_data = b""
        self.kept: tuple[int, ...] | None = None
        self.deadline_s = math.inf
        if not self.receives and not self.synchronous:
            self.deadline_s = now_s

    def pack(self, objects: ObjectDictionary) -> bytes:
        """Return the data bytes of a TPDO with the present values of its objects."""
        return self.layout.pack(*[objects[key] for key in self.keys])

    def due_at_sync(self, data: bytes) -> bool:
        """Count a SYNC; return True if this synchronous TPDO is sent at it."""
        if self._type == 0:
            return data != self.last_data
        self._syncs += 1
        return self._syncs % self._type == 0

    def frame(self, data: bytes, now_s: float) -> Frame:
        """Return the frame of a TPDO, which then counts as sent."""
        self.last_data, self._last_s = data, now_s
        if not self.synchronous:
            self.arm(now_s)
        return Frame(self.cob_id, data)

    def arm(self, now_s: float) -> None:
        """Start the event timer, if its time is not 0."""
        self.deadline_s = (
            now_s + self._clock.true_duration_s(self._event_s) if self._event_s else math.inf
        )

    def allowed_s(self, now_s: float) -> float:
        """Return the earliest time at which the inhibit time allows the next TPDO [s]."""
        return max(now_s, self._last_s + self._clock.true_duration_s(self._inhibit_s))


class PdoTable:
    """The valid PDOs of a simulated drive.

    Attributes:
        received: RPDOs by identifier.
        transmitted: TPDOs in the order of their numbers.
        event_driven: TPDOs that do not wait for SYNC.
        timed: All PDOs whose `deadline_s` is used.
        acts_on_arrival: True if an RPDO takes effect on arrival, without waiting for SYNC.
    """

    def __init__(self, objects: ObjectDictionary, clock: DriveClock) -> None:
        self._objects = objects
        self._clock = clock
        self.received: dict[int, DrivePdo] = {}
        self.transmitted: list[DrivePdo] = []
        self.event_driven: list[DrivePdo] = []
        self.timed: list[DrivePdo] = []
        self.acts_on_arrival = False

    def rebuild(self, *, in_use: bool, now_s: float) -> None:
        """Read the PDOs from the objects, or none unless `in_use` (only in NMT Operational)."""
        objects, clock = self._objects, self._clock
        self.received = {}
        self.transmitted = []
        for number in PDO_NUMBERS if in_use else ():
            if is_valid(objects[RPDO_COMMUNICATION + number - 1, 1]):
                pdo = DrivePdo(objects, clock, RPDO_COMMUNICATION, number, now_s)
                self.received[pdo.cob_id] = pdo
            communication = TPDO_COMMUNICATION + number - 1
            requested = objects[communication, 2] == ON_REQUEST  # sent only on a remote frame
            if is_valid(objects[communication, 1]) and not requested:
                pdo = DrivePdo(objects, clock, TPDO_COMMUNICATION, number, now_s)
                self.transmitted.append(pdo)
        self.event_driven = [pdo for pdo in self.transmitted if not pdo.synchronous]
        self.timed = [*self.received.values(), *self.event_driven]
        self.acts_on_arrival = any(not pdo.synchronous for pdo in self.received.values())

    def check_write(self, index: int, subindex: int, value: int) -> None:
        """Refuse writes to PDO records that CiA 301 does not allow; ignore other objects.

        A PDO's identifier and mapping can be changed only while the PDO is not valid. Single
        mapping entries can be changed only while the number of mapped objects is 0.

        Raises:
            SdoAbort: The write is not allowed now, or the object cannot be mapped into the PDO.
        """
        family = index & _FAMILY_MASK
        if family in (RPDO_COMMUNICATION, TPDO_COMMUNICATION):
            now = self._objects[index, 1]
            moved = is_valid(now) and is_valid(value) and (now ^ value) & _COB_ID_MASK
            if subindex == 1 and (moved or value & _EXTENDED):
                raise SdoAbort(SdoCode.VALUE_INVALID)
        elif family in (RPDO_MAPPING, TPDO_MAPPING):
            communication = index - RPDO_MAPPING + RPDO_COMMUNICATION
            emptied = subindex == 0 or not self._objects[index, 0]
            if is_valid(self._objects[communication, 1]) or not emptied:
                raise SdoAbort(SdoCode.UNSUPPORTED_ACCESS)
            values = [value]
            if subindex == 0:
                values = [self._objects[index, place] for place in range(1, value + 1)]
            self._check_mapped(family, [value for value in values if value or not subindex])

    def _check_mapped(self, family: int, values: list[int]) -> None:
        wanted = "r" if family == RPDO_MAPPING else "t"
        items = [MappedObject.parse(value) for value in values]
        for item in items:
            entry = self._objects.entry(item.index, item.subindex)
            if wanted not in entry.mapping or item.bits != entry.bits:
                raise SdoAbort(SdoCode.NOT_MAPPABLE)
        if sum(item.bits for item in items) > 64:
            raise SdoAbort(SdoCode.PDO_LENGTH_EXCEEDED)
