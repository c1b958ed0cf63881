"""Electronic data sheet (EDS) of a simulated drive, for the preflight and for other programs."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from itertools import groupby
from operator import attrgetter

from config.formats.eds_object import Access, DataType
from drivers.canopen.pdo import RPDO_COMMUNICATION, TPDO_COMMUNICATION
from mock_hw.drive.object_dictionary import ObjectEntry
from mock_hw.drive.objects import (
    ERROR_HISTORY,
    HEARTBEAT_CONSUMER,
    PDO_NUMBERS,
    SimulatedIdentity,
    drive_entries,
)

_TYPES = {
    "b": DataType.INTEGER8,
    "h": DataType.INTEGER16,
    "i": DataType.INTEGER32,
    "B": DataType.UNSIGNED8,
    "H": DataType.UNSIGNED16,
    "I": DataType.UNSIGNED32,
    "s": DataType.VISIBLE_STRING,
}
_VAR, _ARRAY, _RECORD = "0x7", "0x8", "0x9"
_ARRAYS = (ERROR_HISTORY, HEARTBEAT_CONSUMER)
_MANDATORY = (0x1000, 0x1001, 0x1018)
_VENDORS_OWN = range(0x2000, 0x6000)
_IDENTITY = 0x1018
_SERIAL_NUMBER = (_IDENTITY, 4)
_PDO_RECORDS = (RPDO_COMMUNICATION, TPDO_COMMUNICATION)
_WITH_NODE_ID = frozenset(
    ((0x1014, 0), *((record + n - 1, 1) for record in _PDO_RECORDS for n in PDO_NUMBERS))
)
_BIT_RATES_KBIT_S = (10, 20, 50, 125, 250, 500, 800, 1000)


def drive_eds(identity: SimulatedIdentity, file_name: str, created: datetime) -> str:
    """Return the EDS of a simulated drive (CiA 306-1), with all objects that are not hidden.

    CAN identifiers are relative to the node id, so that drives that differ only in their node id
    have the same EDS. Rated torque, encoder and gear are those of the drive.

    Args:
        identity: The drive.
        file_name: File name to write into the EDS.
        created: Creation time to write into the EDS.
    """
    by_index = attrgetter("index")
    seen = [entry for entry in drive_entries(identity) if not entry.hidden]
    entries_of = groupby(sorted(seen, key=by_index), key=by_index)
    objects = {index: tuple(entries) for index, entries in entries_of}
    sections = [
        *_header_sections(objects[_IDENTITY], file_name, created),
        *_object_lists(tuple(objects)),
    ]
    for index, entries in objects.items():
        sections += _object_sections(index, entries, identity.node_id)
    return "\n".join(sections)


def _header_sections(
    who: tuple[ObjectEntry, ...], file_name: str, created: datetime
) -> Iterator[str]:
    numbers = dict(zip(("VendorNumber", "ProductNumber", "RevisionNumber"), who[1:4], strict=True))
    numbers_hex = {key: f"0x{int(entry.default):08X}" for key, entry in numbers.items()}
    date, time = created.strftime("%m-%d-%Y"), created.strftime("%I:%M%p")
    yield _section(
        "FileInfo",
        FileName=file_name,
        FileVersion=1,
        FileRevision=0,
        EDSVersion="4.0",
        Description="Servo drive of a simulated cell (CiA 402)",
        CreationTime=time,
        CreationDate=date,
        CreatedBy="rid-daq",
        ModificationTime=time,
        ModificationDate=date,
        ModifiedBy="rid-daq",
    )
    yield _section(
        "DeviceInfo",
        VendorName="rid-daq",
        ProductName="rid-daq simulated servo drive",
        OrderCode="",
        **numbers_hex,
        **{f"BaudRate_{rate}": 1 for rate in _BIT_RATES_KBIT_S},
        SimpleBootUpMaster=0,
        SimpleBootUpSlave=1,
        Granularity=8,
        DynamicChannelsSupported=0,
        GroupMessaging=0,
        NrOfRXPDO=len(PDO_NUMBERS),
        NrOfTXPDO=len(PDO_NUMBERS),
        LSS_Supported=0,
    )
    yield _section("DummyUsage", **{f"Dummy{number:04d}": 0 for number in range(1, 8)})
    yield _section("Comments", Lines=0)


def _object_lists(indices: tuple[int, ...]) -> Iterator[str]:
    own = [index for index in indices if index in _VENDORS_OWN]
    optional = [index for index in indices if index not in (*_MANDATORY, *own)]
    for title, members in (
        ("MandatoryObjects", _MANDATORY),
        ("OptionalObjects", optional),
        ("ManufacturerObjects", own),
    ):
        listed = {str(place): f"0x{index:04X}" for place, index in enumerate(members, start=1)}
        yield _section(title, SupportedObjects=len(members), **listed)


def _object_sections(index: int, entries: tuple[ObjectEntry, ...], node_id: int) -> Iterator[str]:
    if [entry.subindex for entry in entries] == [0]:
        yield _section(f"{index:04X}", **_variable_keys(entries[0], node_id))
        return
    yield _section(
        f"{index:04X}",
        ParameterName=entries[0].name,
        ObjectType=_ARRAY if index in _ARRAYS else _RECORD,
        SubNumber=len(entries),
    )
    for entry in entries:
        yield _section(f"{index:04X}sub{entry.subindex:X}", **_variable_keys(entry, node_id))


def _variable_keys(entry: ObjectEntry, node_id: int) -> dict[str, object]:
    keys: dict[str, object] = {
        "ParameterName": entry.name,
        "ObjectType": _VAR,
        "DataType": f"0x{_TYPES[entry.code]:04X}",
        "AccessType": _access(entry),
        "DefaultValue": _default(entry, node_id),
        "PDOMapping": int(bool(entry.mapping)),
    }
    if entry.allowed is not None:
        keys |= {"LowLimit": min(entry.allowed), "HighLimit": max(entry.allowed)}
    return keys


def _access(entry: ObjectEntry) -> Access:
    """Return the access type in the EDS; `rww` means writable, also by an RPDO."""
    return "rww" if entry.access == "rw" and entry.mapping == "r" else entry.access


def _default(entry: ObjectEntry, node_id: int) -> str:
    if isinstance(entry.default, bytes):
        return entry.default.decode("ascii")
    if entry.key == _SERIAL_NUMBER:
        return ""
    if entry.key in _WITH_NODE_ID:
        return f"$NODEID+0x{entry.default - node_id:X}"
    return str(entry.default)


def _section(title: str, **keys: object) -> str:
    lines = "".join(f"{key}={value}\n" for key, value in keys.items())
    return f"[{title}]\n{lines}"
