"""`ObjectDictionary`: values of a simulated device's objects, with the checks of CiA 301."""

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
    """One object: address, type, access and allowed values.

    Attributes:
        index: Index of the object.
        subindex: Sub-index of the object.
        name: Name of the object.
        code: Type, as a letter of `struct` (``B b H h I i``), or ``s`` for a text.
        default: Value after a reset.
        access: ``"ro"`` or ``"rw"``.
        mapping: PDOs that may contain the object: ``"r"`` receive, ``"t"`` transmit, ``"rt"`` both.
        allowed: Values that may be written; None for all values of the type.
        hidden: True if only the device itself can use the object; for others it does not exist.
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
    """An object that copies the values written to another one.

    Attributes:
        key: The object that is set.
        of: The object whose values are copied.
        conditions: Objects with the values that they must have; otherwise nothing is copied.
    """

    key: Key
    of: Key
    conditions: tuple[tuple[Key, int], ...] = ()


class ObjectDictionary:
    """Values by index and sub-index; numbers are integers, texts are bytes.

    The device itself reads and writes with ``objects[index, subindex]``, without checks; `read` and
    `decode` serve SDO requests.

    Args:
        entries: The existing objects.
        mirrors: Objects that copy the values of others.
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
        """Return the number of an SDO download, without writing it.

        Raises:
            SdoAbort: There is no such object, it is read-only, or its length or value is not
                allowed.
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
        """Store the present values of the writable objects as their values after a reset."""
        writable = {key for key, entry in self._entries.items() if entry.access == "rw"}
        self._stored |= {key: self._values[key] for key in writable}

    def reset(self, *, communication_only: bool) -> None:
        """Restore the stored values of the communication area, or of every object."""
        for key, entry in self._entries.items():
            if entry.index in COMMUNICATION_AREA or not communication_only:
                self._values[key] = self._stored[key]
