"""Electronic data sheets: their content, and spelling variants of vendors."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Callable

import pytest

from config.formats.eds import ElectronicDataSheet, parse_eds
from config.formats.eds_object import DataType, EdsObject, EdsValue, parse_value
from tests.builders.data_sheet import SHEET, read


def read_object(keys: str, section: str = "[6077]") -> EdsObject:
    """Return the object that a section describes, in an otherwise empty sheet."""
    (item,) = read(f"[DeviceInfo]\n{section}\n{keys}\n").objects
    return item


class TestContentOfASheet:
    def test_the_identity_of_the_device_is_read(self) -> None:
        sheet = read(SHEET)
        assert (sheet.vendor, sheet.product, sheet.revision) == (0xFB, 1617, 0x0170_0000)
        assert (sheet.vendor_name, sheet.product_name) == ("A vendor", "A drive")
        assert sheet.sha256 == hashlib.sha256(SHEET.encode()).hexdigest()
        assert sheet.node_id is None

    def test_objects_are_read_by_address(self) -> None:
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

    def test_identifiers_relative_to_the_node_id_are_computed(self) -> None:
        identifier = read(SHEET).get(0x1400, 1)
        assert identifier is not None
        assert identifier.default == EdsValue(0x200, adds_node_id=True)
        assert identifier.default.of_node(5) == 0x205

    @pytest.mark.parametrize(
        "text",
        ["$NODEID+0x200", "$NodeId + 0x200", "0x200+$NODEID", "$NODEID+512", "$NODEID+01000"],
    )
    def test_spelling_variants_of_the_node_id_are_accepted(self, text: str) -> None:
        item = read_object(f"DataType=7\nDefaultValue={text}")
        assert item.default == EdsValue(0x200, adds_node_id=True)

    def test_an_identifier_can_be_the_node_id(self) -> None:
        assert read_object("DataType=5\nDefaultValue=$NODEID").default == EdsValue(
            0, adds_node_id=True
        )

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
    def test_access_decides_which_pdos_may_contain_an_object(
        self, access: str, writable: bool, receivable: bool, sendable: bool
    ) -> None:
        item = read_object(f"DataType=7\nAccessType={access}\nPDOMapping=1")
        assert (item.writable, item.receivable, item.sendable) == (writable, receivable, sendable)
        item = read_object(f"DataType=7\nAccessType={access}\nPDOMapping=0")
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
    def test_values_are_read_by_their_type(
        self, data_type: int, text: str, value: float | str
    ) -> None:
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
    def test_limits_are_read(self, low: str, high: str, limits: tuple[float, float]) -> None:
        assert read_object(f"DataType=3\nLowLimit={low}\nHighLimit={high}").limits == limits

    def test_a_configured_device_has_values_and_a_node_id(self) -> None:
        text = SHEET.replace(
            "DefaultValue=0x00020192", "DefaultValue=0x00020192\nParameterValue=0x192"
        )
        sheet = read(f"{text}[DeviceComissioning]\nNodeID=0x05\nNodeName=elbow\n")
        assert sheet.node_id == 5
        assert sheet.objects[0].value == EdsValue(0x192)

    def test_an_array_in_compact_notation_is_expanded(self) -> None:
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

    def test_an_element_of_a_compact_array_can_have_its_own_section(self) -> None:
        sheet = read(
            "[DeviceInfo]\n[1016]\nDataType=7\nAccessType=rw\nCompactSubObj=2\n"
            "[1016sub2]\nDataType=7\nAccessType=ro\n"
        )
        assert [item.access for item in sheet.objects] == ["ro", "rw", "ro"]

    def test_a_domain_has_no_length(self) -> None:
        item = read_object("ObjectType=0x2\nAccessType=wo")
        assert (item.data_type, item.bits) == (DataType.DOMAIN, None)


class TestVendorVariants:
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
    def test_the_same_device_in_another_spelling_is_read_equal(
        self, change: Callable[[str], str]
    ) -> None:
        def content_of(sheet: ElectronicDataSheet) -> object:
            return (sheet.vendor, sheet.product, sheet.revision), [
                dataclasses.replace(item, name=item.name.lower(), line=0) for item in sheet.objects
            ]

        changed = change(SHEET)
        assert changed != SHEET
        assert content_of(read(changed)) == content_of(read(SHEET))

    def test_latin_1_is_read_if_the_file_is_not_utf_8(self) -> None:
        for encoding in ("latin-1", "utf-8"):
            text = SHEET.replace("A vendor", "Müller & Söhne").encode(encoding)
            assert parse_eds(text, "drive.eds").vendor_name == "Müller & Söhne"

    def test_an_empty_value_counts_as_missing(self) -> None:
        sheet = read(
            "[DeviceInfo]\nVendorNumber=\nProductNumber= ; none\n[2000]\nDataType=\nLowLimit=\n"
            "AccessType=\nDefaultValue=\nParameterName=\n"
        )
        assert (sheet.vendor, sheet.product, sheet.revision) == (None, None, None)
        assert sheet.objects == (EdsObject(0x2000, 0, "", 4),)

    def test_vendor_specific_types_have_no_length(self) -> None:
        item = read_object("DataType=0x0040\nAccessType=rw\nDefaultValue=anything\nLowLimit=low")
        assert (item.data_type, item.bits, item.low) == (0x40, None, None)
        assert item.default == EdsValue("anything")

    def test_gaps_and_type_definitions_are_not_objects(self) -> None:
        kinds = "".join(f"[{0x2000 + kind:04X}]\nObjectType={kind}\n" for kind in (0, 5, 6, 8, 9))
        assert len(read(f"{SHEET}{kinds}").objects) == 5
