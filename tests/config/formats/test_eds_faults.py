"""Faulty data sheets: every fault is told with its line."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from config.errors import ConfigError
from config.formats.eds import MAX_OBJECTS, ElectronicDataSheet, parse_eds
from config.formats.eds_object import DataType, EdsObject, EdsValue, parse_integer, parse_value
from config.formats.eds_text import MAX_BYTES, MAX_LINE_CHARACTERS
from tests.builders.data_sheet import SHEET, read
from tests.builders.raised_codes import raises_code


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("[1000]", "[1000", 16, r"'\[1000' has no closing \]"),
        ("[1000]", "[1000] x", 16, "stands behind"),
        ("[1018sub1]", "[1018sub0]", 35, "here a second time, first in line 29"),
        ("[1018sub1]", "[1018SUB00]", 35, "second time, first in line 29"),
        ("DataType=0x0007\nAccessType=ro\nDef", "DataType=0x0007\nAccessType\nDef", 20,
         r"'AccessType' in \[1000\] is not key=value"),
        ("AccessType=ro\nDef", "=ro\nDef", 20, "is not key=value"),
        ("AccessType=ro\nDef", "DataType=5\nDef", 20, "'DataType' .*another value"),
        ("AccessType=ro\nDef", "AccessType=rx\nDef", 20, "AccessType of .* 'rx': use one of"),
        ("DataType=0x0003", "DataType=short", 50, r"DataType of \[6077\]: 'short' is not a whole"),
        ("DataType=0x0003", "DataType=65536", 50, "'65536'; it is 0 to 0xffff"),
        ("0x000000FB", "0x1000000FB", 6, "VendorNumber of .*0 to 0xffffffff"),
        ("0x000000FB", "-1", 6, "VendorNumber of"),
        ("1617", "16 17", 8, "'16 17' is not a whole number"),
        ("1617", "0o17", 8, "not a whole number"),
        ("1617", "09", 8, "not a whole number"),
        ("1617", "9" * 5000, 8, "5014 characters; a line has at most 4096"),
        ("1617", "9" * 1000, 8, "too many digits"),
        ("1617", "0x" + "F" * 1000, 8, "too many digits"),
        ("1617", "１７", 8, "not a whole number"),
        ("PDOMapping=1", "PDOMapping=yes", 52, "PDOMapping of"),
        ("ObjectType=0x9", "ObjectType=0x3", 26, "ObjectType of .*no kind of object"),
        ("SubNumber=2", "CompactSubObj=255", 27, "at most 254"),
        ("ParameterName=COB-ID", "ParameterName=a\0b", 41, "a zero byte"),
    ],
)  # fmt: skip
def test_a_fault_is_told_with_its_line(old: str, new: str, line: int, says: str) -> None:
    text = SHEET.replace(old, new)
    if "ObjectType" in new:
        text = text.replace("[1018sub0]", "[1019sub0]").replace("[1018sub1]", "[1019sub1]")
    assert text != SHEET
    with pytest.raises(ConfigError, match=says) as caught:
        read(text)
    assert str(caught.value).startswith(f"drive.eds:{line}: ")
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("$NODEID+0x200", "$NODEID-0x200", 44, r"write \$NODEID\+0x200"),
        ("$NODEID+0x200", "$NODEID+", 44, r"write \$NODEID\+0x200"),
        ("$NODEID+0x200", "0x100000000", 44, "does not fit UNSIGNED32"),
        ("$NODEID+0x200", "-1", 44, "does not fit UNSIGNED32"),
        (
            "$NODEID+0x200",
            "0x200UL",
            44,
            r"^DefaultValue of \[1400sub1\]: '0x200UL' is not a whole",
        ),
        ("$NODEID+0x200", "\x1b[2J", 44, r"'\\x1b\[2J' is not a whole"),
        ("$NODEID+0x200", "9" * 1000, 44, "too many digits"),
        ("LowLimit=0x8000", "LowLimit=low", 53, r"^LowLimit of \[6077\]: 'low' is not a whole"),
        ("LowLimit=0x8000", "ParameterValue=0x10000", 53, "^ParameterValue of .*not fit INTEGER16"),
    ],
)
def test_a_value_that_cannot_be_read_is_a_fault_of_its_object_alone(
    old: str, new: str, line: int, says: str
) -> None:
    sheet = read(SHEET.replace(old, new))
    (faulty,) = [item for item in sheet.objects if item.faults]
    (fault,) = faulty.faults
    assert sheet.faults == (fault,)
    assert fault.line == line
    assert re.search(says, fault.text)
    assert fault.text.isprintable()
    assert (faulty.default, faulty.value, faulty.low).count(None) > 1
    others = [item for item in sheet.objects if item is not faulty]
    assert others == [item for item in read(SHEET).objects if item.index != faulty.index]


def test_a_fault_of_a_compact_array_is_told_once() -> None:
    sheet = read(
        "[DeviceInfo]\n[1003]\nDataType=5\nCompactSubObj=3\nDefaultValue=256\n[1003Value]\n2=x\n"
    )
    assert [fault.line for fault in sheet.faults] == [5, 7]
    assert [len(item.faults) for item in sheet.objects] == [0, 1, 2, 1]


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "there is no .DeviceInfo.; is it an electronic data sheet"),
        (b"name: ir361\n", "drive.eds:1: 'name: ir361' stands before the first .section."),
        (b"\x7fELF\x01\x00\x00", "drive.eds:1: a zero byte"),
        (SHEET.encode("utf-16"), "drive.eds:1: a zero byte"),
        (b"[DeviceInfo]\nVendorNumber=1\n", "no object in it"),
        (b"\x1b[2J\n", r"drive.eds:1: '\\x1b\[2J' stands before"),
        (b"[DeviceInfo]\n\x1b[2J\n", r"drive.eds:2: '\\x1b\[2J' in"),
        (b"[DeviceComissioning]\nNodeID=128\n[DeviceInfo]\n[1000]\n", "drive.eds:2: NodeID of"),
        (b";" * (MAX_BYTES + 1), f"more than {MAX_BYTES} bytes"),
        (b"x" * (MAX_LINE_CHARACTERS + 1), "4097 characters"),
    ],
)
def test_what_is_no_data_sheet(data: bytes, says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        parse_eds(data, "drive.eds")


def test_so_many_objects_are_no_device() -> None:
    compact = "".join(f"[{i:04X}]\nDataType=7\nCompactSubObj=254\n" for i in range(0x2000, 0x2100))
    with pytest.raises(ConfigError, match=rf"drive\.eds:\d+: more than {MAX_OBJECTS} objects"):
        read(f"[DeviceInfo]\n{compact}")
    subs = "".join(f"[{i:04X}sub{k:X}]\n" for i in range(0x2000, 0x2100) for k in range(200))
    with pytest.raises(ConfigError, match=rf"drive\.eds:\d+: more than {MAX_OBJECTS} objects"):
        read(f"[DeviceInfo]\n{subs}")


@pytest.mark.parametrize("text", ["", " 1", "1 ", "+", "0x", "0b1", "1_0", "1.0", "٣"])
def test_no_number(text: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(repr(text))):
        parse_integer(text)


@pytest.mark.parametrize("text", ["nan", "inf", "-1e999", "0x7F800000", "1,5", "1" * 100])
def test_no_real_number(text: str) -> None:
    with pytest.raises(ConfigError):
        parse_value(text, DataType.REAL32)


class TestASheetIsValid:
    def test_or_is_not_made(self) -> None:
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

    def test_nor_an_object(self) -> None:
        for changed in ({"index": 0x10000}, {"subindex": 256}, {"access": "rx"}):
            with pytest.raises(ConfigError):
                EdsObject(**({"index": 1, "subindex": 0, "name": "", "line": 1} | changed))  # type: ignore[arg-type]
        with pytest.raises(ConfigError):
            EdsValue("text", adds_node_id=True)
        with pytest.raises(ConfigError):
            EdsValue(float("nan"))
