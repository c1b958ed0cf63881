"""PDO configuration: mapping entries, and the order in which a mapping must be written.

The order is that of CiA 301, 7.5.2.33 to 7.5.2.38: make the PDO invalid, set its number of mapped
objects to 0, write the mapping entries, set the number of mapped objects, set the transmission
type, and at last make the PDO valid again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from config.errors import ProtocolError

RPDO_COMMUNICATION = 0x1400
RPDO_MAPPING = 0x1600
TPDO_COMMUNICATION = 0x1800
TPDO_MAPPING = 0x1A00

INVALID = 0x8000_0000
NO_RTR = 0x4000_0000
COB_ID_MASK = INVALID | 0x7FF
EVERY_SYNC = 1
ON_EVENT = 255
PREDEFINED_NUMBERS = (1, 2, 3, 4)


@dataclass(frozen=True, slots=True)
class MappedObject:
    """An object in a PDO: index, sub-index and length in bits."""

    index: int
    subindex: int
    bits: int

    def entry(self) -> int:
        """Return the object's 32-bit entry in a mapping record (CiA 301, figure 74)."""
        return self.index << 16 | self.subindex << 8 | self.bits

    @classmethod
    def parse(cls, entry: int) -> MappedObject:
        """Return the object of a 32-bit entry in a mapping record."""
        return cls(entry >> 16 & 0xFFFF, entry >> 8 & 0xFF, entry & 0xFF)


@dataclass(frozen=True, slots=True)
class ObjectWrite:
    """One SDO write: index and sub-index of the object, and the bytes."""

    index: int
    subindex: int
    data: bytes


@dataclass(frozen=True)
class PdoMapping:
    """Configuration of one PDO.

    Attributes:
        direction: ``"rpdo"`` (the device receives) or ``"tpdo"`` (the device transmits).
        number: Number of the PDO from 1; the records of PDO 1 are 1400h and 1600h (RPDO), or 1800h
            and 1A00h (TPDO).
        cob_id: CAN identifier of the PDO.
        objects: The mapped objects, in the order of their bytes.
        transmission_type: 1 to 240: transmitted with every n-th SYNC; 254, 255: transmitted on an
            event.
        event_timer_ms: Period with which an event-driven TPDO is sent even without a change [ms]; 0
            to send it only after a change.
        fixed: True if the device defines the mapped objects; they are then not written, but read
            and compared.
    """

    direction: Literal["rpdo", "tpdo"]
    number: int
    cob_id: int
    objects: tuple[MappedObject, ...]
    transmission_type: int = EVERY_SYNC
    event_timer_ms: int = 0
    fixed: bool = False

    def __post_init__(self) -> None:
        if not 1 <= self.number <= 512:
            raise ProtocolError(
                f"PDO number {self.number} is outside 1 to 512", code="RID-DRIVE-DATA-SIZE"
            )
        if self.bits > 64 or any(item.bits % 8 for item in self.objects):
            raise ProtocolError(
                f"{self.direction} {self.number}: {self.bits} bits are mapped; whole bytes and at"
                " most 64 bits fit a frame",
                code="RID-DRIVE-DATA-SIZE",
            )

    @property
    def bits(self) -> int:
        """Total length of the mapped objects [bit]."""
        return sum(item.bits for item in self.objects)

    @property
    def communication_index(self) -> int:
        """Index of the communication record: identifier, transmission type and timers."""
        base = RPDO_COMMUNICATION if self.direction == "rpdo" else TPDO_COMMUNICATION
        return base + self.number - 1

    @property
    def mapping_index(self) -> int:
        """Index of the mapping record: the mapped objects."""
        base = RPDO_MAPPING if self.direction == "rpdo" else TPDO_MAPPING
        return base + self.number - 1

    @property
    def valid_cob_id(self) -> int:
        """Communication record's sub-index 1 of the valid PDO; remote requests are not allowed."""
        return self.cob_id | (NO_RTR if self.direction == "tpdo" else 0)

    def writes(self) -> Iterator[ObjectWrite]:
        """Yield the SDO writes that configure this PDO, in the order that CiA 301 requires."""
        if not self.fixed:
            yield ObjectWrite(self.communication_index, 1, _u32(self.valid_cob_id | INVALID))
            yield ObjectWrite(self.mapping_index, 0, b"\0")
            for position, item in enumerate(self.objects, start=1):
                yield ObjectWrite(self.mapping_index, position, _u32(item.entry()))
            yield ObjectWrite(self.mapping_index, 0, bytes((len(self.objects),)))
        yield ObjectWrite(self.communication_index, 2, bytes((self.transmission_type,)))
        if self.event_timer_ms:
            yield ObjectWrite(
                self.communication_index, 5, self.event_timer_ms.to_bytes(2, "little")
            )
        yield ObjectWrite(self.communication_index, 1, _u32(self.valid_cob_id))

    def read_back(self) -> Iterator[ObjectWrite]:
        """Yield the object values that the drive must have after `writes`.

        Bit 30 of the identifier is not compared.
        """
        yield ObjectWrite(self.mapping_index, 0, bytes((len(self.objects),)))
        for position, item in enumerate(self.objects, start=1):
            yield ObjectWrite(self.mapping_index, position, _u32(item.entry()))
        yield ObjectWrite(self.communication_index, 2, bytes((self.transmission_type,)))
        if self.event_timer_ms:
            yield ObjectWrite(
                self.communication_index, 5, self.event_timer_ms.to_bytes(2, "little")
            )
        yield ObjectWrite(self.communication_index, 1, _u32(self.valid_cob_id))

    def is_identifier(self, held: ObjectWrite) -> bool:
        """Return True if an object of this PDO is its identifier."""
        return (held.index, held.subindex) == (self.communication_index, 1)

    def part_name(self, index: int, subindex: int) -> str:
        """Return the name of an object of this PDO's records."""
        if index == self.mapping_index:
            return f"object {subindex}" if subindex else "number of objects"
        return {1: "identifier", 2: "transmission type", 5: "event timer [ms]"}[subindex]


def is_valid(cob_id_entry: int) -> bool:
    """Return True if the value of a communication record's sub-index 1 marks the PDO as valid."""
    return not cob_id_entry & INVALID


def split(objects: tuple[MappedObject, ...], data: bytes) -> list[bytes]:
    """Return the bytes of each mapped object in a PDO's data.

    Raises:
        ProtocolError: The data are shorter than the mapped objects. Surplus bytes are ignored, as
            CiA 301, 7.2.2.1 allows.
    """
    needed = sum(item.bits for item in objects) // 8
    if len(data) < needed:
        raise ProtocolError(
            f"a PDO has {len(data)} bytes, but its mapped objects need {needed}: check the PDO"
            " mapping of the drive",
            code="RID-DRIVE-DATA-SIZE",
        )
    parts, start = [], 0
    for item in objects:
        end = start + item.bits // 8
        parts.append(data[start:end])
        start = end
    return parts


def _u32(value: int) -> bytes:
    return value.to_bytes(4, "little")
