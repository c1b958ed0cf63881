"""PDO configuration: mapping entries, and the order in which a mapping must be written.

CiA 301, 7.5.2.33 to 7.5.2.38: a PDO is switched off, its mapping emptied, its entries written, its
mapping switched on, its transmission type set; only then is it made valid again.
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
        """Return the U32 of the mapping record (CiA 301, figure 74)."""
        return self.index << 16 | self.subindex << 8 | self.bits

    @classmethod
    def parse(cls, entry: int) -> MappedObject:
        """Read a U32 of the mapping record."""
        return cls(entry >> 16 & 0xFFFF, entry >> 8 & 0xFF, entry & 0xFF)


@dataclass(frozen=True, slots=True)
class ObjectWrite:
    """One SDO write: object and bytes."""

    index: int
    subindex: int
    data: bytes


@dataclass(frozen=True)
class PdoMapping:
    """Configuration of one PDO.

    Attributes:
        direction: ``"rpdo"`` (the device receives) or ``"tpdo"`` (the device transmits).
        number: 1 for the first PDO, whose records are 1400h/1600h or 1800h/1A00h.
        cob_id: Identifier of its frame.
        objects: The mapped objects, in order.
        transmission_type: 1 to 240: synchronous, with every n-th SYNC; 254, 255: on an event.
        event_timer_ms: Period at which an event-driven TPDO is sent even without a change; 0 for
            none.
        fixed: Whether the device defines its objects, so that they are only read back.
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
        """The mapped length [bit]."""
        return sum(item.bits for item in self.objects)

    @property
    def communication_index(self) -> int:
        """The record with identifier, transmission type and timers."""
        base = RPDO_COMMUNICATION if self.direction == "rpdo" else TPDO_COMMUNICATION
        return base + self.number - 1

    @property
    def mapping_index(self) -> int:
        """The record with the mapped objects."""
        base = RPDO_MAPPING if self.direction == "rpdo" else TPDO_MAPPING
        return base + self.number - 1

    @property
    def valid_cob_id(self) -> int:
        """The U32 of sub-index 1 of a valid PDO; a TPDO must not be requested by remote frame."""
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
        """Yield the expected values after `writes` (bit 30 of the identifier may differ)."""
        yield ObjectWrite(self.mapping_index, 0, bytes((len(self.objects),)))
        for position, item in enumerate(self.objects, start=1):
            yield ObjectWrite(self.mapping_index, position, _u32(item.entry()))
        yield ObjectWrite(self.communication_index, 2, bytes((self.transmission_type,)))
        if self.event_timer_ms:
            yield ObjectWrite(
                self.communication_index, 5, self.event_timer_ms.to_bytes(2, "little")
            )
        yield ObjectWrite(self.communication_index, 1, _u32(self.valid_cob_id))


def is_valid(cob_id_entry: int) -> bool:
    """Return whether a communication record's sub-index 1 marks the PDO as valid."""
    return not cob_id_entry & INVALID


def split(objects: tuple[MappedObject, ...], data: bytes) -> list[bytes]:
    """Split a PDO's bytes by its objects.

    Raises:
        ProtocolError: The frame is shorter than the mapping. A longer one is cut, as CiA 301,
            7.2.2.1 allows.
    """
    needed = sum(item.bits for item in objects) // 8
    if len(data) < needed:
        raise ProtocolError(
            f"a PDO has {len(data)} bytes, but {needed} are mapped",
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
