"""Electronic data sheets as vendors write them, and every fault with its line."""

from __future__ import annotations

import dataclasses
import hashlib
import re
from collections.abc import Callable

import pytest

from config.eds import MAX_OBJECTS, ElectronicDataSheet, parse_eds
from config.eds_object import DataType, EdsObject, EdsValue, parse_integer, parse_value
from config.eds_text import MAX_BYTES, MAX_LINE_CHARACTERS
from config.errors import ConfigError

SHEET = """[FileInfo]
FileName=drive.eds

[DeviceInfo]
VendorName=A vendor
VendorNumber=0x000000FB
ProductName=A drive
ProductNumber=1617
RevisionNumber=0x01700000
NrOfRXPDO=4

[Comments]
Lines=1
Line1=anything may stand here

[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue=0x00020192
PDOMapping=0

[1018]
ParameterName=Identity
ObjectType=0x9
SubNumber=2

[1018sub0]
ParameterName=Number of entries
DataType=0x0005
AccessType=const
DefaultValue=4

[1018sub1]
ParameterName=Vendor
DataType=0x0007
AccessType=ro

[1400sub1]
ParameterName=COB-ID
DataType=0x0007
AccessType=rw
DefaultValue=$NODEID+0x200
LowLimit=0x00000181
HighLimit=0xFFFFFFFF

[6077]
ParameterName=Torque actual value
DataType=0x0003
AccessType=ro
PDOMapping=1
LowLimit=0x8000
HighLimit=32767
"""


def read(text: str) -> ElectronicDataSheet:
    return parse_eds(text.encode(), "drive.eds")


def only(keys: str, section: str = "[6077]") -> EdsObject:
    """Return the object that a section describes, in an otherwise empty sheet."""
    (item,) = read(f"[DeviceInfo]\n{section}\n{keys}\n").objects
    return item


class TestWhatASheetSays:
    def test_who_the_device_is(self) -> None:
        sheet = read(SHEET)
        assert (sheet.vendor, sheet.product, sheet.revision) == (0xFB, 1617, 0x0170_0000)
        assert (sheet.vendor_name, sheet.product_name) == ("A vendor", "A drive")
        assert sheet.sha256 == hashlib.sha256(SHEET.encode()).hexdigest()
        assert sheet.node_id is None

    def test_its_objects_by_address(self) -> None:
        sheet = read(SHEET)
        addresses = [(item.index, item.subindex) for item in sheet.objects]
        assert addresses == [(0x1000, 0), (0x1018, 0), (0x1018, 1), (0x1400, 1), (0x6077, 0)]
        torque = sheet.get(0x6077, 0)
        assert torque is not None
        assert torque.name == "Torque actual value"
        assert torque.data_type == DataType.INTEGER16
        assert torque.bits == 16
        assert torque.limits == (-32768, 32767)
        assert torque.sendable
        assert not torque.receivable
        assert not torque.writable
        assert sheet.get(0x6078, 0) is None

    def test_identifiers_are_counted_from_the_node_id(self) -> None:
        identifier = read(SHEET).get(0x1400, 1)
        assert identifier is not None
        assert identifier.default == EdsValue(0x200, adds_node_id=True)
        assert identifier.default.of_node(5) == 0x205

    @pytest.mark.parametrize(
        "text",
        ["$NODEID+0x200", "$NodeId + 0x200", "0x200+$NODEID", "$NODEID+512", "$NODEID+01000"],
    )
    def test_however_that_is_spelt(self, text: str) -> None:
        item = only(f"DataType=7\nDefaultValue={text}")
        assert item.default == EdsValue(0x200, adds_node_id=True)

    def test_the_node_id_alone(self) -> None:
        assert only("DataType=5\nDefaultValue=$NODEID").default == EdsValue(0, adds_node_id=True)

    @pytest.mark.parametrize(
        ("access", "writable", "receivable", "sendable"),
        [
            ("ro", False, False, True),
            ("const", False, False, True),
            ("wo", True, True, False),
            ("rw", True, True, True),
            ("rww", True, True, False),
            ("rwr", True, False, True),
            ("RWW", True, True, False),
        ],
    )
    def test_access_says_which_pdos_may_carry_an_object(
        self, access: str, writable: bool, receivable: bool, sendable: bool
    ) -> None:
        item = only(f"DataType=7\nAccessType={access}\nPDOMapping=1")
        assert (item.writable, item.receivable, item.sendable) == (writable, receivable, sendable)
        item = only(f"DataType=7\nAccessType={access}\nPDOMapping=0")
        assert (item.receivable, item.sendable) == (False, False)

    @pytest.mark.parametrize(
        ("data_type", "text", "value"),
        [
            (0x01, "1", 1),
            (0x02, "0xFF", -1),
            (0x02, "-128", -128),
            (0x03, "0x7FFF", 32767),
            (0x07, "4294967295", 0xFFFF_FFFF),
            (0x07, "0XfF", 255),
            (0x07, "017", 15),
            (0x07, "00", 0),
            (0x10, "0x800000", -(2**23)),
            (0x15, "0xFFFFFFFFFFFFFFFF", -1),
            (0x08, "1.5", 1.5),
            (0x08, "0x3FC00000", 1.5),
            (0x11, "-1e-3", -0.001),
            (0x09, "A; drive", "A; drive"),
            (0x0A, "00 FF", "00 FF"),
            (0x0F, "anything", "anything"),
        ],
    )
    def test_values_by_their_type(self, data_type: int, text: str, value: float | str) -> None:
        assert parse_value(text, data_type) == EdsValue(value)

    @pytest.mark.parametrize(
        ("low", "high", "limits"),
        [
            ("-5", "0x7FFF", (-5, 32767)),
            ("0xFFFB", "5", (-5, 5)),
            ("0", "0", (-float("inf"), float("inf"))),
            ("5", "-5", (-float("inf"), float("inf"))),
            ("9", "9", (9, 9)),
            ("", "7", (-float("inf"), 7)),
            ("-2147483648", "0xFFFFFFFF", (-(2**31), 2**32 - 1)),
        ],
    )
    def test_limits(self, low: str, high: str, limits: tuple[float, float]) -> None:
        assert only(f"DataType=3\nLowLimit={low}\nHighLimit={high}").limits == limits

    def test_a_configured_device(self) -> None:
        text = SHEET.replace(
            "DefaultValue=0x00020192", "DefaultValue=0x00020192\nParameterValue=0x192"
        )
        sheet = read(f"{text}[DeviceComissioning]\nNodeID=0x05\nNodeName=elbow\n")
        assert sheet.node_id == 5
        assert sheet.objects[0].value == EdsValue(0x192)

    def test_an_array_written_compactly(self) -> None:
        sheet = read(
            "[DeviceInfo]\n[1003]\nParameterName=Error field\nObjectType=8\nDataType=7\n"
            "AccessType=ro\nCompactSubObj=3\n[1003Name]\nNrOfEntries=1\n2=the middle one\n"
            "[1003Value]\nNrOfEntries=1\n3=0x8130\n"
        )
        number, first, second, third = sheet.objects
        assert (number.subindex, number.data_type, number.default) == (0, 5, EdsValue(3))
        assert (first.name, second.name) == ("Error field 1", "the middle one")
        assert [item.access for item in (first, second, third)] == ["ro"] * 3
        assert (first.value, third.value) == (None, EdsValue(0x8130))

    def test_one_of_its_objects_may_be_described_by_itself(self) -> None:
        sheet = read(
            "[DeviceInfo]\n[1016]\nDataType=7\nAccessType=rw\nCompactSubObj=2\n"
            "[1016sub2]\nDataType=7\nAccessType=ro\n"
        )
        assert [item.access for item in sheet.objects] == ["ro", "rw", "ro"]

    def test_a_domain_has_no_length(self) -> None:
        item = only("ObjectType=0x2\nAccessType=wo")
        assert (item.data_type, item.bits) == (DataType.DOMAIN, None)


class TestWhatVendorsDo:
    @pytest.mark.parametrize(
        "change",
        [
            lambda text: text.replace("\n", "\r\n"),
            lambda text: text.replace("\n", "\r"),
            lambda text: "\ufeff" + text,
            lambda text: text.replace("=", " = "),
            lambda text: text.replace("=", "\t=\t"),
            lambda text: text.replace("\n", "  \n"),
            lambda text: "\n".join(f"  {line}" for line in text.splitlines()),
            lambda text: text.replace("\n", " ; said the vendor\n").replace("\n ;", "\n;"),
            lambda text: f"; a comment\n# and another\n\n{text}",
            lambda text: text.upper().replace("0X", "0x").replace("A VENDOR", "A vendor"),
            lambda text: text.replace("0x0007", "7").replace("0x0003", "3"),
            lambda text: text.replace("SubNumber=2\n", ""),
            lambda text: text.replace("sub1]", "sub01]").replace("sub0]", "SUB00]"),
            lambda text: text.replace("[Comments]", "[Vendor's]\nno equals sign\n=\n[Comments]"),
            lambda text: text.replace("[Comments]", "[Comments]\nLines=\n[Comments]"),
            lambda text: text.replace("PDOMapping=0", "PDOMapping=\nObjFlags=0x1\nUnit=rpm"),
            lambda text: text.replace("[1018]\nParameterName=Identity", "[1018]"),
            lambda text: text.replace("[FileInfo]", "[FileInfo] ; what it is"),
            lambda text: text.replace("[DeviceInfo]", "[ DeviceInfo ]"),
            lambda text: text.replace("VendorName=A vendor", "VendorName=A vendor\n" * 2),
            lambda text: text[text.index("[DeviceInfo]") :],
            lambda text: text[text.index("[1000]") :] + text[: text.index("[1000]")],
        ],
    )  # fmt: skip
    def test_the_same_device_otherwise_written(self, change: Callable[[str], str]) -> None:
        def said(sheet: ElectronicDataSheet) -> object:
            return (sheet.vendor, sheet.product, sheet.revision), [
                dataclasses.replace(item, name=item.name.lower(), line=0) for item in sheet.objects
            ]

        changed = change(SHEET)
        assert changed != SHEET
        assert said(read(changed)) == said(read(SHEET))

    def test_latin_1_is_read_where_it_is_not_utf_8(self) -> None:
        for encoding in ("latin-1", "utf-8"):
            text = SHEET.replace("A vendor", "Müller & Söhne").encode(encoding)
            assert parse_eds(text, "drive.eds").vendor_name == "Müller & Söhne"

    def test_what_is_empty_is_not_said(self) -> None:
        sheet = read(
            "[DeviceInfo]\nVendorNumber=\nProductNumber= ; none\n[2000]\nDataType=\nLowLimit=\n"
            "AccessType=\nDefaultValue=\nParameterName=\n"
        )
        assert (sheet.vendor, sheet.product, sheet.revision) == (None, None, None)
        assert sheet.objects == (EdsObject(0x2000, 0, "", 4),)

    def test_types_of_a_vendor_have_no_length(self) -> None:
        item = only("DataType=0x0040\nAccessType=rw\nDefaultValue=anything\nLowLimit=low")
        assert (item.data_type, item.bits, item.low) == (0x40, None, None)
        assert item.default == EdsValue("anything")

    def test_gaps_and_types_are_no_objects(self) -> None:
        kinds = "".join(f"[{0x2000 + kind:04X}]\nObjectType={kind}\n" for kind in (0, 5, 6, 8, 9))
        assert len(read(f"{SHEET}{kinds}").objects) == 5


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

        def sheet(**changed: object) -> ElectronicDataSheet:
            said = {
                "vendor": 1,
                "product": 2,
                "revision": None,
                "node_id": None,
                "objects": (item,),
            }
            return ElectronicDataSheet(
                name="x.eds", sha256="", vendor_name="", product_name="", **(said | changed)
            )  # type: ignore[arg-type]

        assert sheet().get(0x1000, 0) is item
        for changed in (
            {"vendor": -1},
            {"revision": 1 << 32},
            {"node_id": 0},
            {"objects": (item,) * 2},
        ):
            with pytest.raises(ConfigError, match=r"x\.eds"):
                sheet(**changed)

    def test_nor_an_object(self) -> None:
        for changed in ({"index": 0x10000}, {"subindex": 256}, {"access": "rx"}):
            with pytest.raises(ConfigError):
                EdsObject(**({"index": 1, "subindex": 0, "name": "", "line": 1} | changed))  # type: ignore[arg-type]
        with pytest.raises(ConfigError):
            EdsValue("text", adds_node_id=True)
        with pytest.raises(ConfigError):
            EdsValue(float("nan"))
