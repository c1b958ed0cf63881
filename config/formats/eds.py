"""`ElectronicDataSheet`: identity and objects of a CANopen device, from its EDS or DCF file.

Source: CiA 306-1. Vendors' files differ from it. Missing or unknown sections, keys and counters are
therefore skipped, and objects are read from their own sections and not from the lists. Sections and
keys must be valid; an error names file and line. If the type, access, value or limit of an object
cannot be read, this is stored as a fault of the object, not raised: many files contain such faults
at objects that are not used.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NoReturn, TypeVar

from config.errors import ConfigError
from config.formats.eds_object import (
    ACCESSES,
    Access,
    DataType,
    EdsFault,
    EdsObject,
    EdsValue,
    parse_integer,
    parse_limit,
    parse_value,
)
from config.formats.eds_text import EdsSection, parse_sections, refuse_line, shown

MAX_OBJECTS = 30_000

_VAR, _ARRAY, _RECORD, _DOMAIN = 0x7, 0x8, 0x9, 0x2
_NO_OBJECTS = (0x0, 0x5, 0x6)  # a gap, a type, a structure
_COMPACT = range(1, 255)
_ACCESS: dict[str, Access] = {access: access for access in ACCESSES}

T = TypeVar("T")


@dataclass(frozen=True)
class ElectronicDataSheet:
    """Description of a device type or, with `node_id`, of one device (DCF).

    A number that the file does not state is None.

    Attributes:
        name: Name of the file in messages.
        sha256: Hash of the file's bytes.
        vendor, product, revision: VendorNumber, ProductNumber and RevisionNumber, the expected
            content of 1018h.
        vendor_name, product_name: Unescaped text of the file: escape it before showing it.
        node_id: Node id of the device that a DCF configures.
        objects: Sorted by index and sub-index.
    """

    name: str
    sha256: str
    vendor: int | None
    product: int | None
    revision: int | None
    vendor_name: str
    product_name: str
    node_id: int | None
    objects: tuple[EdsObject, ...]

    def __post_init__(self) -> None:
        for number in (self.vendor, self.product, self.revision):
            if number is not None and not 0 <= number < 1 << 32:
                raise ConfigError(
                    f"{self.name}: {number} does not fit the 32 bits of 1018h; correct the file",
                    code="RID-EDS-INVALID",
                )
        if self.node_id is not None and not 1 <= self.node_id <= 127:
            raise ConfigError(
                f"{self.name}: node id {self.node_id} is outside 1 to 127; correct the file",
                code="RID-EDS-INVALID",
            )
        if len(self._by_address) != len(self.objects):
            raise ConfigError(
                f"{self.name}: two objects have the same index and sub-index; remove one",
                code="RID-EDS-INVALID",
            )

    @cached_property
    def _by_address(self) -> dict[tuple[int, int], EdsObject]:
        return {(item.index, item.subindex): item for item in self.objects}

    @property
    def faults(self) -> tuple[EdsFault, ...]:
        """The values that cannot be read, without duplicates."""
        faults = dict.fromkeys(fault for item in self.objects for fault in item.faults)
        return tuple(sorted(faults, key=lambda fault: fault.line))

    def get(self, index: int, subindex: int) -> EdsObject | None:
        """Return an object; None if the EDS does not contain it."""
        return self._by_address.get((index, subindex))


def parse_eds(data: bytes, name: str) -> ElectronicDataSheet:
    """Read an electronic data sheet, EDS or DCF.

    Args:
        data: The file's bytes, at most 4 MB.
        name: Name of the file in messages.

    Raises:
        ConfigError: The file is too large or not a data sheet, or a line is invalid; the message
            then has `name:line`.
    """
    reader = _Reader(name, parse_sections(data, name))
    info = reader.sections.get("deviceinfo")
    if info is None:
        raise ConfigError(
            f"{name}: section [DeviceInfo] is missing; is it an electronic data sheet (EDS or"
            " DCF)?",
            code="RID-FILE-TYPE",
        )
    objects = reader.objects()
    if not objects:
        raise ConfigError(
            f"{name}: it contains no object (a section such as [1000]): check that the file"
            " is complete",
            code="RID-FILE-TYPE",
        )
    return ElectronicDataSheet(
        name=name,
        sha256=hashlib.sha256(data).hexdigest(),
        vendor=reader.integer(info, "vendornumber", range(1 << 32)),
        product=reader.integer(info, "productnumber", range(1 << 32)),
        revision=reader.integer(info, "revisionnumber", range(1 << 32)),
        vendor_name=reader.text(info, "vendorname"),
        product_name=reader.text(info, "productname"),
        node_id=reader.node_id(),
        objects=objects,
    )


class _Reader:
    def __init__(self, name: str, sections: dict[str, EdsSection]) -> None:
        self.name = name
        self.sections = sections

    def text(self, section: EdsSection, key: str) -> str:
        entry = section.get(key)
        return "" if entry is None else entry.text

    def integer(self, section: EdsSection, key: str, allowed: range) -> int | None:
        entry = section.get(key)
        if entry is None:
            return None
        try:
            return _parse_in_range(entry.text, allowed)
        except ConfigError as error:
            refuse_line(self.name, entry.line, f"{entry.key} of [{section.name}]: {error}")

    def node_id(self) -> int | None:
        for title in (
            "devicecomissioning",
            "devicecommissioning",
        ):  # CiA's spelling; correct spelling
            section = self.sections.get(title)
            if section is not None:
                return self.integer(section, "nodeid", range(1, 128))
        return None

    def objects(self) -> tuple[EdsObject, ...]:
        found: dict[tuple[int, int], EdsObject] = {}
        parents: list[EdsSection] = []
        composed: set[int] = set()
        for title, section in self.sections.items():
            if len(title) == 4:
                parents.append(section)
            elif title[4:7] == "sub":
                index, subindex = int(title[:4], 16), int(title[7:], 16)
                composed.add(index)
                found[index, subindex] = self._object(section, index, subindex)
        for section in parents:
            index = int(section.name, 16)
            for item in self._of_parent(section, index, composed=index in composed):
                found.setdefault((index, item.subindex), item)
            if len(found) > MAX_OBJECTS:
                refuse_line(
                    self.name, section.line, f"more than {MAX_OBJECTS} objects; is it one device?"
                )
        return tuple(found[address] for address in sorted(found))

    def _of_parent(self, section: EdsSection, index: int, *, composed: bool) -> Iterable[EdsObject]:
        """Return the objects in a section such as [1018]: one, a compact array, or none."""
        kind = self.integer(section, "objecttype", range(0x100))
        compact = self.integer(section, "compactsubobj", range(0x100)) or 0
        if compact:
            if compact not in _COMPACT:
                self._refuse_key(section, "compactsubobj", "an array has at most 254 objects")
            return self._array(section, index, compact)
        if composed or kind in (_ARRAY, _RECORD, *_NO_OBJECTS):
            return ()
        if kind not in (None, _VAR, _DOMAIN):
            self._refuse_key(section, "objecttype", "unknown kind of object; use 0x7, 0x8 or 0x9")
        if kind is None and section.get("subnumber") is not None:
            return ()
        return (self._object(section, index, 0),)

    def _array(self, section: EdsSection, index: int, count: int) -> list[EdsObject]:
        """Return the objects of an array with CompactSubObj (CiA 306-1, 4.6.3.3)."""
        first = self._object(section, index, 1)
        names = self.sections.get(f"{section.name.lower()}name")
        values = self.sections.get(f"{section.name.lower()}value")
        number = EdsObject(
            index, 0, first.name, section.line, DataType.UNSIGNED8, "ro", default=EdsValue(count)
        )
        items = [number]
        for place in range(1, count + 1):
            name = "" if names is None else self.text(names, str(place))
            value, faults = first.value, list(first.faults)
            if values is not None and values.get(str(place)) is not None:
                value = self._value(values, str(place), first.data_type, faults)
            items.append(
                replace(
                    first,
                    subindex=place,
                    name=name or f"{first.name} {place}",
                    value=value,
                    faults=tuple(faults),
                )
            )
        return items

    def _object(self, section: EdsSection, index: int, subindex: int) -> EdsObject:
        faults: list[EdsFault] = []
        data_type = _number(section, "datatype", range(1 << 16), faults)
        if data_type is None and _number(section, "objecttype", range(0x100), []) == _DOMAIN:
            data_type = DataType.DOMAIN
        access = _parse_or_note(section, "accesstype", _parse_access, faults)
        mappable = _number(section, "pdomapping", range(0x100), faults)
        return EdsObject(
            index=index,
            subindex=subindex,
            name=self.text(section, "parametername"),
            line=section.line,
            data_type=data_type,
            access=access,
            mappable=bool(mappable),
            default=self._value(section, "defaultvalue", data_type, faults),
            value=self._value(section, "parametervalue", data_type, faults),
            low=self._limit(section, "lowlimit", data_type, faults),
            high=self._limit(section, "highlimit", data_type, faults),
            faults=tuple(faults),
        )

    def _value(
        self, section: EdsSection, key: str, data_type: int | None, faults: list[EdsFault]
    ) -> EdsValue | None:
        return _parse_or_note(section, key, lambda text: parse_value(text, data_type), faults)

    def _limit(
        self, section: EdsSection, key: str, data_type: int | None, faults: list[EdsFault]
    ) -> int | float | None:
        return _parse_or_note(section, key, lambda text: parse_limit(text, data_type), faults)

    def _refuse_key(self, section: EdsSection, key: str, advice: str) -> NoReturn:
        entry = section.entries[key]
        where = f"{entry.key} of [{section.name}]"
        refuse_line(self.name, entry.line, f"{where} is {shown(entry.text)}: {advice}")


def _number(section: EdsSection, key: str, allowed: range, faults: list[EdsFault]) -> int | None:
    """Return the integer of a key; None if it is missing, cannot be read, or is out of range."""
    return _parse_or_note(section, key, lambda text: _parse_in_range(text, allowed), faults)


def _parse_in_range(text: str, allowed: range) -> int:
    number = parse_integer(text)
    if number not in allowed:
        raise ConfigError(
            f"{shown(text)} is out of range; give {allowed[0]} to {allowed[-1]:#x}",
            code="RID-EDS-INVALID",
        )
    return number


def _parse_access(text: str) -> Access:
    access = _ACCESS.get(text.lower())
    if access is None:
        raise ConfigError(
            f"{shown(text)} is unknown; use one of {', '.join(ACCESSES)}", code="RID-EDS-INVALID"
        )
    return access


def _parse_or_note(
    section: EdsSection, key: str, parse: Callable[[str], T], faults: list[EdsFault]
) -> T | None:
    """Return the value of a key; None if it is missing or, with a new fault, if unreadable."""
    entry = section.get(key)
    if entry is None:
        return None
    try:
        return parse(entry.text)
    except ConfigError as error:
        faults.append(EdsFault(entry.line, f"{entry.key} of [{section.name}]: {error}"))
        return None
