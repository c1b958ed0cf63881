"""Faulty data sheets: every fault is reported with its line."""

from __future__ import annotations

from dataclasses import replace

import pytest

from config.errors import ConfigError
from config.formats.eds import MAX_OBJECTS, ElectronicDataSheet, parse_eds
from config.formats.eds_object import DataType, EdsObject, EdsValue, parse_integer, parse_value
from config.formats.eds_text import MAX_BYTES, MAX_LINE_CHARACTERS
from tests.builders.data_sheet import SHEET, read
from tests.builders.raised_codes import raises_code

INVALID, TWICE, NO_TEXT = "RID-EDS-INVALID", "RID-FILE-DUPLICATE", "RID-FILE-TYPE"


@pytest.mark.parametrize(
    ("old", "new", "line", "code", "details"),
    [
        ("[1000]", "[1000", 16, INVALID, ("'[1000'", "[section]")),
        ("[1000]", "[1000] x", 16, INVALID, ("' x'", "[section]")),
        ("[1018sub1]", "[1018sub0]", 35, TWICE, ("[1018sub0]", "line 29")),
        ("[1018sub1]", "[1018SUB00]", 35, TWICE, ("[1018SUB00]", "line 29")),
        ("DataType=0x0007\nAccessType=ro\nDef", "DataType=0x0007\nAccessType\nDef", 20,
         INVALID, ("'AccessType'", "[1000]", "key=value")),
        ("AccessType=ro\nDef", "=ro\nDef", 20, INVALID, ("'=ro'", "[1000]", "key=value")),
        ("AccessType=ro\nDef", "DataType=5\nDef", 20, TWICE, ("'DataType'", "line 19")),
        ("0x000000FB", "0x1000000FB", 6, INVALID, ("VendorNumber", "'0x1000000FB'", "0xffffffff")),
        ("0x000000FB", "-1", 6, INVALID, ("VendorNumber", "'-1'", "0xffffffff")),
        ("1617", "16 17", 8, INVALID, ("ProductNumber", "'16 17'", "0x")),
        ("1617", "0o17", 8, INVALID, ("ProductNumber", "'0o17'", "0x")),
        ("1617", "09", 8, INVALID, ("ProductNumber", "'09'", "0x")),
        ("1617", "9" * 5000, 8, INVALID, ("5014", "4096")),
        ("1617", "9" * 1000, 8, INVALID, ("ProductNumber", "'999999999999999999999999'…")),
        ("1617", "0x" + "F" * 1000, 8, INVALID, ("ProductNumber", "'0xFFFFFFFFFFFFFFFFFFFFFF'…")),
        ("1617", "１７", 8, INVALID, ("ProductNumber", "'１７'", "0x")),
        ("ObjectType=0x9", "ObjectType=0x3", 26, INVALID, ("ObjectType", "[1018]", "0x7, 0x8")),
        ("SubNumber=2", "CompactSubObj=255", 27, INVALID, ("CompactSubObj", "'255'", "254")),
        ("ParameterName=COB-ID", "ParameterName=a\0b", 41, NO_TEXT, ("UTF-8",)),
        ("[FileInfo]", "<?xml version='1.0'?>\n[FileInfo]", 1, NO_TEXT, ("XDD", "EDS")),
    ],
)  # fmt: skip
def test_a_fault_is_reported_with_its_line(
    old: str, new: str, line: int, code: str, details: tuple[str, ...]
) -> None:
    text = SHEET.replace(old, new)
    if "ObjectType" in new:
        text = text.replace("[1018sub0]", "[1019sub0]").replace("[1018sub1]", "[1019sub1]")
    assert text != SHEET
    with raises_code(ConfigError, code, *details) as caught:
        read(text)
    assert str(caught.value).startswith(f"drive.eds:{line}: ")
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("old", "new", "line", "details"),
    [
        ("$NODEID+0x200", "$NODEID-0x200", 44, ("'$NODEID-0x200'", "$NODEID+0x200")),
        ("$NODEID+0x200", "$NODEID+", 44, ("'$NODEID+'", "$NODEID+0x200")),
        ("$NODEID+0x200", "0x100000000", 44, ("'0x100000000'", "UNSIGNED32")),
        ("$NODEID+0x200", "-1", 44, ("'-1'", "UNSIGNED32")),
        ("$NODEID+0x200", "0x200UL", 44, ("DefaultValue", "[1400sub1]", "'0x200UL'", "0x")),
        ("$NODEID+0x200", "\x1b[2J", 44, (r"'\x1b[2J'", "0x")),
        ("$NODEID+0x200", "9" * 1000, 44, ("'999999999999999999999999'…",)),
        ("AccessType=ro\nDef", "AccessType=rx\nDef", 20, ("AccessType", "'rx'", "ro, wo")),
        ("DataType=0x0003", "DataType=short", 50, ("DataType", "[6077]", "'short'")),
        ("DataType=0x0003", "DataType=65536", 50, ("DataType", "'65536'", "0xffff")),
        ("PDOMapping=1", "PDOMapping=yes", 52, ("PDOMapping", "[6077]", "'yes'")),
        ("LowLimit=0x8000", "LowLimit=low", 53, ("LowLimit", "[6077]", "'low'", "0x")),
        ("LowLimit=0x8000", "ParameterValue=0x10000", 53, ("ParameterValue", "INTEGER16")),
    ],
)
def test_an_unreadable_value_is_a_fault_of_its_object_alone(
    old: str, new: str, line: int, details: tuple[str, ...]
) -> None:
    sheet = read(SHEET.replace(old, new))
    (faulty,) = [item for item in sheet.objects if item.faults]
    (fault,) = faulty.faults
    assert sheet.faults == (fault,)
    assert fault.line == line
    assert all(detail in fault.text for detail in details), fault.text
    assert fault.text.isprintable()
    assert (faulty.default, faulty.value, faulty.low).count(None) > 1
    others = [item for item in sheet.objects if item is not faulty]
    assert others == [item for item in read(SHEET).objects if item.index != faulty.index]


def test_a_fault_of_a_compact_array_is_reported_once() -> None:
    sheet = read(
        "[DeviceInfo]\n[1003]\nDataType=5\nCompactSubObj=3\nDefaultValue=256\n[1003Value]\n2=x\n"
    )
    assert [fault.line for fault in sheet.faults] == [5, 7]
    assert [len(item.faults) for item in sheet.objects] == [0, 1, 2, 1]


@pytest.mark.parametrize(
    ("data", "code", "details"),
    [
        (b"", NO_TEXT, ("drive.eds: ", "[DeviceInfo]")),
        (b"name: ir361\n", NO_TEXT, ("drive.eds:1: 'name: ir361'", "[section]")),
        (b"\x7fELF\x01\x00\x00", NO_TEXT, ("drive.eds:1: ", "UTF-8")),
        (SHEET.encode("utf-16"), NO_TEXT, ("drive.eds:1: ", "UTF-8")),
        (b"[DeviceInfo]\nVendorNumber=1\n", NO_TEXT, ("drive.eds: ", "[1000]")),
        (b"\x1b[2J\n", NO_TEXT, (r"drive.eds:1: '\x1b[2J'", "[section]")),
        (b"[DeviceInfo]\n\x1b[2J\n", INVALID, (r"drive.eds:2: '\x1b[2J'", "key=value")),
        (
            b"[DeviceComissioning]\nNodeID=128\n[DeviceInfo]\n[1000]\n",
            INVALID,
            ("drive.eds:2: NodeID", "'128'", "0x7f"),
        ),
        (b";" * (MAX_BYTES + 1), NO_TEXT, (f"{MAX_BYTES} bytes",)),
        (b"x" * (MAX_LINE_CHARACTERS + 1), INVALID, ("4097", "4096")),
    ],
)
def test_a_file_that_is_not_a_data_sheet_is_refused(
    data: bytes, code: str, details: tuple[str, ...]
) -> None:
    with raises_code(ConfigError, code, *details):
        parse_eds(data, "drive.eds")


def test_too_many_objects_are_refused() -> None:
    compact = "".join(f"[{i:04X}]\nDataType=7\nCompactSubObj=254\n" for i in range(0x2000, 0x2100))
    with raises_code(ConfigError, INVALID, "drive.eds:353: ", str(MAX_OBJECTS)):
        read(f"[DeviceInfo]\n{compact}")
    subs = "".join(f"[{i:04X}sub{k:X}]\n" for i in range(0x2000, 0x2100) for k in range(200))
    with raises_code(ConfigError, INVALID, "drive.eds:30001: ", str(MAX_OBJECTS)):
        read(f"[DeviceInfo]\n{subs}")


@pytest.mark.parametrize("text", ["", " 1", "1 ", "+", "0x", "0b1", "1_0", "1.0", "٣"])
def test_an_invalid_integer_is_refused(text: str) -> None:
    with raises_code(ConfigError, INVALID, repr(text)):
        parse_integer(text)


@pytest.mark.parametrize("text", ["nan", "inf", "-1e999", "0x7F800000", "1,5", "1" * 100])
def test_an_invalid_real_number_is_refused(text: str) -> None:
    with pytest.raises(ConfigError):
        parse_value(text, DataType.REAL32)


class TestConstructedSheets:
    def test_an_invalid_sheet_is_refused(self) -> None:
        item = EdsObject(0x1000, 0, "", 1)

        sheet = ElectronicDataSheet(
            name="x.eds",
            sha256="",
            vendor=1,
            product=2,
            revision=None,
            vendor_name="",
            product_name="",
            node_id=None,
            objects=(item,),
        )
        assert sheet.get(0x1000, 0) is item
        for wrong in (
            lambda: replace(sheet, vendor=-1),
            lambda: replace(sheet, revision=1 << 32),
            lambda: replace(sheet, node_id=0),
            lambda: replace(sheet, objects=(item,) * 2),
        ):
            with raises_code(ConfigError, "RID-EDS-INVALID", "x.eds"):
                wrong()

    def test_an_invalid_object_is_refused(self) -> None:
        for changed in ({"index": 0x10000}, {"subindex": 256}, {"access": "rx"}):
            with pytest.raises(ConfigError):
                EdsObject(**({"index": 1, "subindex": 0, "name": "", "line": 1} | changed))  # type: ignore[arg-type]
        with pytest.raises(ConfigError):
            EdsValue("text", adds_node_id=True)
        with pytest.raises(ConfigError):
            EdsValue(float("nan"))
