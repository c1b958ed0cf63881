"""Data sheets of simulated drives, read by us and by the `canopen` package."""

from __future__ import annotations

import io
import warnings
from datetime import datetime
from fractions import Fraction
from pathlib import Path

import canopen
import pytest
from canopen.objectdictionary import ODVariable
from hypothesis import given, settings
from hypothesis import strategies as st

from config.errors import ConfigError
from config.formats.eds import ElectronicDataSheet, parse_eds
from config.formats.eds_object import INTEGER_BITS, Access, DataType, EdsObject, EdsValue
from config.load import load_cell
from drivers.data_sheets.eds_check import eds_findings
from mock_hw.drive.eds import drive_eds
from mock_hw.drive.object_dictionary import ObjectDictionary
from mock_hw.drive.objects import SimulatedIdentity, drive_entries
from tests.builders.raised_codes import raises_code

CREATED = datetime(2026, 1, 2, 15, 4)
NODE = 5

identities = st.builds(
    SimulatedIdentity,
    node_id=st.integers(1, 126),
    encoder_increments=st.integers(1, 2**32 - 1),
    gear=st.fractions(min_value=Fraction(1, 1000), max_value=1000, max_denominator=1000),
    rated_torque_mnm=st.integers(1, 2**32 - 1),
)
integers = st.sampled_from(sorted(INTEGER_BITS.keys() - {DataType.BOOLEAN}))
names = st.text(
    st.characters(min_codepoint=33, max_codepoint=126, exclude_characters=";"), max_size=30
)


@st.composite
def values(draw: st.DrawFn, data_type: int) -> EdsValue:
    bits = INTEGER_BITS[data_type]
    signed = DataType(data_type).name.startswith("INTEGER")
    low = -(1 << bits - 1) if signed else 0
    number = draw(st.integers(low, low + (1 << bits) - 1))
    return EdsValue(number, adds_node_id=draw(st.booleans()) and not signed)


@st.composite
def objects(draw: st.DrawFn) -> EdsObject:
    data_type = draw(integers)
    # canopen knows the limits of signed types with 8, 16, 32 and 64 bits
    limited = data_type in (2, 3, 4, 5, 6, 7) and draw(st.booleans())
    low, high = sorted((draw(values(data_type)).content, draw(values(data_type)).content))
    return EdsObject(
        index=draw(st.integers(0x1000, 0x9FFF)),
        subindex=draw(st.integers(0, 0xFE)),
        name=draw(names),
        line=0,
        data_type=data_type,
        access=draw(st.sampled_from(Access.__args__)),  # type: ignore[attr-defined]
        mappable=draw(st.booleans()),
        default=draw(st.none() | values(data_type)),
        value=draw(st.none() | values(data_type)),
        low=low if limited else None,  # type: ignore[arg-type]
        high=high if limited else None,  # type: ignore[arg-type]
    )


def compare_with_canopen(sheet: ElectronicDataSheet, text: str) -> int:
    """Compare every object with canopen's reading of the text; return the number of objects."""
    dictionary = canopen.import_od(_named(text), node_id=NODE)
    compared = 0
    for item in sheet.objects:
        judged = dictionary[item.index]
        if not isinstance(judged, ODVariable):
            judged = judged[item.subindex]
        default, value = (
            None if stated is None else stated.of_node(NODE)
            for stated in (item.default, item.value)
        )
        assert (judged.name, judged.data_type) == (item.name, item.data_type)
        assert (judged.access_type, judged.pdo_mappable) == (item.access, item.mappable)
        assert (judged.default, judged.value) == (default, value)
        assert (judged.min, judged.max) == (item.low, item.high)
        assert len(judged) == item.bits or item.bits in (None, 24, 40, 48, 56)
        compared += 1
    members = [1 if isinstance(item, ODVariable) else len(item) for item in dictionary.values()]
    assert sum(members) == compared
    return compared


def _named(text: str) -> io.StringIO:
    file = io.StringIO(text)
    file.name = "sheet.eds"  # canopen recognises the format by the file's name
    return file


@pytest.mark.parametrize("cell", ["ir361", "kr15"])
def test_every_object_of_a_simulated_drive_is_in_its_sheet_as_canopen_reads_it(cell: str) -> None:
    loaded = load_cell(cell)
    assert loaded.plant is not None
    for axis, joint, simulated in zip(
        loaded.config.axes, loaded.robot.joints, loaded.plant.axes, strict=True
    ):
        identity = SimulatedIdentity.of_axis(loaded.config, axis, joint, simulated)
        text = drive_eds(identity, "node.eds", CREATED)
        sheet = parse_eds(text.encode(), "node.eds")
        entries = list(drive_entries(identity))
        assert compare_with_canopen(sheet, text) == len(entries) == len(sheet.objects)
        for entry in entries:
            item = sheet.get(*entry.key)
            assert item is not None
            assert item.writable == (entry.access == "rw")
            assert item.receivable == ("r" in entry.mapping)
            assert item.sendable == ("t" in entry.mapping)
            if entry.code != "s":
                assert item.bits == entry.bits
            if item.default is not None:
                default = item.default.of_node(axis.node_id)
                held = entry.default
                assert default == (held.decode() if isinstance(held, bytes) else held)
        assert eds_findings(sheet, loaded.config, axis) == ()
        exchange = loaded.config.model_copy(update={"exchange": "trimmed"})
        assert eds_findings(sheet, exchange, axis) == ()


@settings(max_examples=20)
@given(identity=identities)
def test_the_sheet_of_any_simulated_drive_is_read_equally_by_both(
    identity: SimulatedIdentity,
) -> None:
    text = drive_eds(identity, "node.eds", CREATED)
    sheet = parse_eds(text.encode(), "node.eds")
    answers = ObjectDictionary(drive_entries(identity))
    assert (sheet.vendor, sheet.product, sheet.revision) == tuple(
        answers[0x1018, subindex] for subindex in (1, 2, 3)
    )
    assert compare_with_canopen(sheet, text) == len(sheet.objects) > 150


@pytest.mark.parametrize(
    ("increments", "gear", "rated_mnm", "number"),
    [(0, 100, 1500, "node 5"), (4096, 2**32, 1500, "4294967296"), (4096, 100, -1, "-1")],
)
def test_a_motor_beyond_the_range_of_its_objects_is_refused(
    increments: int, gear: int, rated_mnm: int, number: str
) -> None:
    with raises_code(ConfigError, "RID-MOCK-RANGE", number):
        SimulatedIdentity(NODE, increments, Fraction(gear), rated_mnm)


def test_drives_that_differ_only_in_their_node_id_have_one_sheet() -> None:
    sheets = {
        drive_eds(SimulatedIdentity(node, 4096, Fraction(100), 1500), "drive.eds", CREATED)
        for node in (1, 2, 126)
    }
    assert len(sheets) == 1


def test_a_sheet_rewritten_by_canopen_has_the_same_content(tmp_path: Path) -> None:
    text = drive_eds(SimulatedIdentity(NODE, 4096, Fraction(100), 1500), "drive.eds", CREATED)
    path = tmp_path / "again.eds"
    with path.open("w") as file, warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", DeprecationWarning
        )  # canopen calls a deprecated clock function
        canopen.export_od(canopen.import_od(_named(text), node_id=NODE), file, "eds")
    again = parse_eds(path.read_bytes(), "again.eds")
    first = parse_eds(text.encode(), "drive.eds")
    assert again.product == first.product

    def content_of(sheet: ElectronicDataSheet) -> list[object]:
        return [(i.index, i.subindex, i.data_type, i.access, i.mappable, i.default, i.limits)
                for i in sheet.objects]  # fmt: skip

    assert content_of(again) == content_of(first)


def write_sheet(
    items: list[EdsObject], number: str, equals: str, comment: str, newline: str, case: str
) -> str:
    """Return the text of a data sheet with these objects, in one of the allowed spellings."""

    def spelt(value: EdsValue) -> str:
        content = value.content
        assert isinstance(content, int)
        text = format(content, number) if content >= 0 else str(content)
        return f"$NODEID+{text}" if value.adds_node_id else text

    lines = ["[DeviceInfo]", f"VendorNumber{equals}0x1F"]
    for index in dict.fromkeys(item.index for item in items):
        lines += [f"[{index:04{case}}]", f"ParameterName{equals}parent", f"ObjectType{equals}0x9"]
    for item in items:
        keys = {
            "ParameterName": item.name,
            "DataType": f"{item.data_type:#06x}",
            "AccessType": item.access,
            "PDOMapping": int(item.mappable),
            "DefaultValue": "" if item.default is None else spelt(item.default),
            "ParameterValue": None if item.value is None else spelt(item.value),
            "LowLimit": item.low,
            "HighLimit": item.high,
        }
        lines.append(f"[{item.index:04{case}}sub{item.subindex:{case}}]")
        lines += [
            f"{key}{equals}{value_text}{comment}"
            for key, value_text in keys.items()
            if value_text is not None
        ]
    return newline.join([*lines, ""])


@settings(max_examples=60)
@given(
    items=st.lists(
        objects(), min_size=1, max_size=12, unique_by=lambda item: (item.index, item.subindex)
    ),
    number=st.sampled_from(["d", "#x", "#X"]),
    equals=st.sampled_from(["=", " = ", "\t=  "]),
    comment=st.sampled_from(["", " ", " ; a comment", "\t;"]),
    newline=st.sampled_from(["\n", "\r\n", "\r"]),
    case=st.sampled_from("xX"),
)
def test_a_written_sheet_is_read_back_equal_as_canopen_reads_it(
    items: list[EdsObject], number: str, equals: str, comment: str, newline: str, case: str
) -> None:
    text = write_sheet(items, number, equals, comment, newline, case)
    sheet = parse_eds(text.encode(), "sheet.eds")
    assert sheet.vendor == 31
    expected = sorted(items, key=lambda item: (item.index, item.subindex))
    for found, item in zip(sheet.objects, expected, strict=True):
        for field in ("index", "subindex", "name", "data_type", "access", "mappable"):
            assert getattr(found, field) == getattr(item, field)
        assert (found.default, found.value) == (item.default, item.value)
        assert (found.low, found.high) == (item.low, item.high)
        assert text.splitlines()[found.line - 1].startswith("[")
    assert compare_with_canopen(sheet, "\n".join(text.splitlines())) == len(items)
