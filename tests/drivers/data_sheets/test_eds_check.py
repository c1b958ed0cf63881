"""Objects that a drive's data sheet must contain, and the findings if they are missing."""

from __future__ import annotations

import pytest

from config.cell.cell import CellConfig
from config.formats.eds import parse_eds
from drivers.data_sheets.eds_check import EdsFinding, eds_findings

COMMUNICATION = {
    "1000": "7 ro 0", "1001": "5 ro 1", "1005": "7 rw 0", "1017": "6 rw 0", "1016sub1": "7 rw 0",
    "1029sub1": "5 rw 0",
    **{f"{i}sub1": "7 rw 0" for i in (1400, 1401, 1800, 1801)},
    **{f"{i}sub2": "5 rw 0" for i in (1400, 1401, 1800, 1801)},
    "1801sub5": "6 rw 0",
    **{f"{i}sub0": "5 rw 0" for i in ("1600", "1601", "1A00", "1A01")},
    **{f"{i}sub{k}": "7 rw 0" for i in ("1600", "1601", "1A00", "1A01") for k in (1, 2, 3)},
}  # fmt: skip
PROFILE = {
    "6007": "3 rw 0", "6040": "6 rww 1", "6041": "6 ro 1", "605A": "3 rw 0", "605E": "3 rw 0",
    "6060": "2 rw 0", "6064": "4 ro 1", "6065": "7 rw 0", "6066": "6 rw 0", "6072": "6 rw 0",
    "6076": "7 ro 0", "6077": "3 ro 1", "6085": "7 rw 0", "608Fsub1": "7 ro 0",
    "608Fsub2": "7 ro 0", "60B2": "3 rw 1", "60C2sub1": "5 rw 0", "60C2sub2": "2 rw 0",
    "60FF": "4 rww 1", "6502": "7 ro 0",
}  # fmt: skip


def findings_on(
    cell: CellConfig,
    objects: dict[str, str | None] | None = None,
    more: str = "",
) -> tuple[EdsFinding, ...]:
    """Return the findings on a small complete sheet with some objects changed or removed (None)."""
    lines = ["[DeviceInfo]", "VendorNumber=1"]
    for title, entry in (COMMUNICATION | PROFILE | (objects or {})).items():
        if entry is not None:
            entry, *delivered = entry.splitlines()
            data_type, access, mapping, *limits = entry.split()
            lines += [f"[{title}]", f"DataType={data_type}", f"AccessType={access}"]
            lines += [f"PDOMapping={mapping}", f"ParameterName=the\x1b[31m {title}", *delivered]
            lines += [
                f"{key}={text}"
                for key, text in zip(("LowLimit", "HighLimit"), limits, strict=False)
            ]
    sheet = parse_eds(f"{chr(10).join(lines)}\n{more}".encode(), "drive.eds")
    return eds_findings(sheet, cell, cell.axes[0])


def test_a_complete_sheet_has_no_findings(cell: CellConfig) -> None:
    assert findings_on(cell) == ()
    assert findings_on(cell.model_copy(update={"exchange": "trimmed"})) == ()


def test_objects_that_a_drive_may_lack_may_be_missing(cell: CellConfig) -> None:
    assert findings_on(cell, {"1029sub1": None, "1401sub1": None, "1601sub0": None}) == ()
    assert findings_on(cell, {"1005": None, "6502": None, "60B2": None, "6066": None}) == ()


@pytest.mark.parametrize("title", ["6007", "605A", "605E"])
def test_a_missing_reaction_object_is_left_to_the_test_on_the_drive(
    cell: CellConfig, title: str
) -> None:
    (finding,) = findings_on(cell, {title: None})
    assert (finding.found, finding.verdict) == (
        "not in the EDS: the watchdog test must show the reaction",
        "shown",
    )


def test_a_read_only_object_may_have_the_required_value(cell: CellConfig) -> None:
    read_only = "2 ro 0\nDefaultValue="
    assert findings_on(cell, {"60C2sub2": read_only + "-3"}) == ()
    (finding,) = findings_on(cell, {"60C2sub2": read_only + "-2"})
    assert (finding.found, finding.verdict) == ("AccessType ro", "red")


def test_a_mode_missing_in_the_list_of_the_sheet_is_red(cell: CellConfig) -> None:
    assert findings_on(cell, {"6502": "7 ro 0\nDefaultValue=0"}) == ()
    assert findings_on(cell, {"6502": "7 ro 0\nDefaultValue=0x165"}) == ()
    (finding,) = findings_on(cell, {"6502": "7 ro 0\nDefaultValue=0x65"})
    assert finding.found == "65h does not list this mode"
    assert finding.verdict == "red"


@pytest.mark.parametrize(
    ("title", "entry", "address", "name", "required", "is_found"),
    [
        ("6077", None, "6077h:00", "in TPDO 1", "16 bit, mappable", "not in the EDS"),
        ("6077", "3 ro 0", "6077h:00", "in TPDO 1", "16 bit, mappable", "PDOMapping 0"),
        ("6077", "4 ro 1", "6077h:00", "in TPDO 1", "16 bit, mappable", "INTEGER32"),
        ("6077", "0x40 ro 1", "6077h:00", "in TPDO 1", "16 bit, mappable", "DataType 0x0040"),
        ("6077", "3 wo 1", "6077h:00", "in TPDO 1", "16 bit, mappable", "AccessType wo"),
        ("60FF", "4 ro 1", "60FFh:00", "in RPDO 1", "32 bit, mappable", "AccessType ro"),
        ("60FF", "4 rwr 1", "60FFh:00", "in RPDO 1", "32 bit, mappable", "AccessType rwr"),
        ("1016sub1", None, "1016h:01", "heartbeat", "32 bit, writable", "not in the EDS"),
        ("6007", "3 ro 0", "6007h:00", "abort connection", "16 bit, writable", "AccessType ro"),
        ("6072", "7 rw 0", "6072h:00", "torque limit", "16 bit, writable", "UNSIGNED32"),
        ("1029sub1", "5 ro 0", "1029h:01", "reaction to", "8 bit, writable", "AccessType ro"),
        ("1400sub1", "7 ro 0", "1400h:01", "RPDO 1 conf", "32 bit, writable", "AccessType ro"),
        ("1A00sub3", None, "1A00h:03", "TPDO 1 conf", "32 bit, writable", "not in the EDS"),
        ("6077", "3 ro 1 low", "6077h:00", "in TPDO 1", "16 bit, mappable", "line LINE: LowLimit"),
        ("6072", "6 rw 0 low", "6072h:00", "torque", "16 bit, writable", "line LINE: LowLimit"),
        ("6065", "6 rw 0", "6065h:00", "following-error", "32 bit, writable", "UNSIGNED16"),
    ],
)
def test_missing_objects_are_reported_with_index_and_name(
    cell: CellConfig,
    title: str,
    entry: str | None,
    address: str,
    name: str,
    required: str,
    is_found: str,
) -> None:
    (finding,) = findings_on(cell, {title: entry})
    assert (finding.object_name, finding.required) == (address, required)
    assert finding.found.startswith(is_found.replace("LINE", str(finding.line + 5)))
    assert name in finding.name
    assert finding.verdict == "red"
    assert (finding.line > 0) == (entry is not None)
    if entry is not None:
        assert finding.name.endswith(rf"(the\x1b[31m {title})")


@pytest.mark.parametrize(
    ("title", "entry", "address", "required", "is_found"),
    [
        ("6060", "2 rw 0 1 7", "6060h:00", "accepts 9", "limits 1 to 7"),
        ("605A", "3 rw 0 5 8", "605Ah:00", "accepts 2", "limits 5 to 8"),
        ("60C2sub2", "2 rw 0 0xFC 0xFC", "60C2h:02", "accepts -3", "limits -4 to -4"),
        ("1016sub1", "7 rw 0 0 65535", "1016h:01", "accepts 8323152", "limits 0 to 65535"),
    ],
)
def test_limits_are_shown_without_a_verdict(
    cell: CellConfig, title: str, entry: str, address: str, required: str, is_found: str
) -> None:
    (finding,) = findings_on(cell, {title: entry})
    assert (finding.object_name, finding.required, finding.found) == (address, required, is_found)
    assert finding.verdict == "shown"


def test_limits_that_depend_on_the_encoder_are_left_to_the_drive(cell: CellConfig) -> None:
    assert findings_on(cell, {"6065": "7 rw 0 0 1", "6085": "7 rw 0 0 1"}) == ()


def test_the_trimmed_exchange_needs_the_second_pdos(cell: CellConfig) -> None:
    trimmed = cell.model_copy(update={"exchange": "trimmed"})
    changed = {"60B2": None, "1401sub2": None, "1801sub5": "7 rw 0", "1601sub1": "7 const 0"}
    assert [finding.object_name for finding in findings_on(trimmed, changed)] == [
        "1601h:01", "1401h:02", "1801h:05",
    ]  # fmt: skip


def test_a_drive_that_may_lack_the_watchdog_may_lack_it_in_its_sheet(cell: CellConfig) -> None:
    safety = cell.drive_safety.model_copy(
        update={"allow_drive_without_watchdog": (cell.axes[0].node_id,)}
    )
    findings = findings_on(
        cell.model_copy(update={"drive_safety": safety}),
        {"1016sub1": None, "6007": None, "1017": None},
    )
    assert {finding.object_name: finding.verdict for finding in findings} == {
        "1017h:00": "red", "1016h:01": "allowed", "6007h:00": "allowed",
    }  # fmt: skip


def test_a_dcf_of_another_node_is_red(cell: CellConfig) -> None:
    (finding,) = findings_on(cell, more="[DeviceComissioning]\nNodeID=77\n")
    assert (finding.name, finding.found) == ("node id", "77")
    node = cell.axes[0].node_id
    assert findings_on(cell, more=f"[DeviceComissioning]\nNodeID={node}\n") == ()
