"""`ObjectDictionary`: objects of a simulated device, with values and the checks of CiA 301."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from config.errors import ConfigError
from drivers.canopen.sdo import SdoAbort, SdoCode, object_name

Key = tuple[int, int]

COMMUNICATION_AREA = range(0x1000, 0x2000)


@dataclass(frozen=True, slots=True)
class ObjectEntry:
    """Description of one object: address, type, access and allowed values.

    Attributes:
        index: Index of the object.
        subindex: Sub-index of the object.
        name: Name of the object.
        code: Type of the value, as a letter of `struct` (``B b H h I i``), or ``s`` for a text.
        default: Value after a reset, until other values are stored.
        access: ``"ro"`` or ``"rw"``.
        mapping: PDOs that can contain the object: ``"r"`` RPDOs, ``"t"`` TPDOs, ``"rt"`` both
            kinds, ``""`` none.
        allowed: Values that may be written; None for all values of the type.
        hidden: True if only the device itself uses the object; SDO clients get the answer that it
            does not exist.
    """

    index: int
    subindex: int
    name: str
    code: str
    default: int | bytes
    access: Literal["ro", "rw"] = "ro"
    mapping: Literal["", "r", "t", "rt"] = ""
    allowed: range | frozenset[int] | None = None
    hidden: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.default, bytes):
            return
        try:
            struct.pack(f"<{self.code}", self.default)
        except struct.error:
            raise ConfigError(
                f"a simulated drive cannot store {self.default} in the {self.bits} bits of"
                f" {object_name(self.index, self.subindex)} ({self.name}): correct the ratings"
                " and units in the axis's servo",
                code="RID-MOCK-RANGE",
            ) from None

    @property
    def key(self) -> Key:
        """Index and sub-index."""
        return self.index, self.subindex

    @property
    def bits(self) -> int:
        """Length of the object in a PDO [bit]."""
        return 8 * struct.calcsize(f"<{self.code}")


@dataclass(frozen=True, slots=True)
class Mirror:
    """A rule by which an object gets every value that is written to another object.

    Attributes:
        key: The object that gets the values.
        of: The object to which the values are written.
        conditions: Objects with required values; a value is copied only while all these objects
            have them.
    """

    key: Key
    of: Key
    conditions: tuple[tuple[Key, int], ...] = ()


class ObjectDictionary:
    """Values of all objects of a device; numbers are integers, texts are bytes.

    The device itself reads and writes with ``objects[index, subindex]``, without checks; `read` and
    `decode` serve SDO requests.

    Args:
        entries: The existing objects.
        mirrors: Rules by which objects get the values of other objects.
    """

    def __init__(self, entries: Iterable[ObjectEntry], mirrors: Iterable[Mirror] = ()) -> None:
        self._mirrors = {mirror.of: mirror for mirror in mirrors}
        self._entries = {entry.key: entry for entry in entries}
        self._indices = {index for (index, _), entry in self._entries.items() if not entry.hidden}
        self._stored = {key: entry.default for key, entry in self._entries.items()}
        self._values = dict(self._stored)

    def __getitem__(self, key: Key) -> int:
        value = self._values[key]
        assert isinstance(value, int)
        return value

    def __setitem__(self, key: Key, value: int) -> None:
        self._values[key] = value
        if key in self._mirrors:
            mirror = self._mirrors[key]
            if all(self._values[other] == wanted for other, wanted in mirror.conditions):
                self._values[mirror.key] = value

    def __contains__(self, key: Key) -> bool:
        return key in self._entries

    def entry(self, index: int, subindex: int) -> ObjectEntry:
        """Return the description of an object.

        Raises:
            SdoAbort: There is no such object or sub-index.
        """
        entry = self._entries.get((index, subindex))
        if entry is None or entry.hidden:
            known = index in self._indices
            raise SdoAbort(SdoCode.NO_SUBINDEX if known else SdoCode.NO_OBJECT, index, subindex)
        return entry

    def read(self, index: int, subindex: int) -> bytes:
        """Return an object's bytes for an SDO upload.

        Raises:
            SdoAbort: There is no such object or sub-index.
        """
        entry = self.entry(index, subindex)
        value = self._values[entry.key]
        return value if isinstance(value, bytes) else struct.pack(f"<{entry.code}", value)

    def decode(self, index: int, subindex: int, data: bytes) -> int:
        """Check the data of an SDO download; return them as a number, without writing it.

        Raises:
            SdoAbort: There is no such object, the object is read-only, or the length or the value
                is not allowed.
        """
        entry = self.entry(index, subindex)
        if entry.access == "ro":
            raise SdoAbort(SdoCode.READ_ONLY, index, subindex)
        size = entry.bits // 8
        if len(data) != size:
            code = SdoCode.LENGTH_TOO_HIGH if len(data) > size else SdoCode.LENGTH_TOO_LOW
            raise SdoAbort(code, index, subindex)
        (value,) = struct.unpack(f"<{entry.code}", data)
        if entry.allowed is not None and value not in entry.allowed:
            raise SdoAbort(SdoCode.VALUE_INVALID, index, subindex)
        return int(value)

    def store(self) -> None:
        """Store the present values of all writable objects; a reset restores the stored values."""
        writable = {key for key, entry in self._entries.items() if entry.access == "rw"}
        self._stored |= {key: self._values[key] for key in writable}

    def reset(self, *, communication_only: bool) -> None:
        """Restore the stored values of all objects, or only of those in the communication area."""
        for key, entry in self._entries.items():
            if entry.index in COMMUNICATION_AREA or not communication_only:
                self._values[key] = self._stored[key]
