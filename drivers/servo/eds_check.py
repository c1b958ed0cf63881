"""What a drive's data sheet must know for it to be used here, and what it lacks: `EdsFinding`.

Nothing is asked of the drive: this is told before anything is written to it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from config.cell.cell import CellConfig, DriveAxis
from config.formats.eds import ElectronicDataSheet
from config.formats.eds_object import DataType, EdsObject, is_signed
from drivers.canopen.pdo import MappedObject, PdoMapping
from drivers.canopen.sdo import object_name
from drivers.device_text import printable
from drivers.servo.cia402 import AxisUnits
from drivers.servo.requirements import Requirement, cyclic_pdos, safety_requirements

_READ = (
    Requirement(0x1000, 0, 4, "device profile", write=False),
    Requirement(0x1001, 0, 1, "error register", write=False),
    Requirement(0x6041, 0, 2, "statusword", write=False),
    Requirement(0x6076, 0, 4, "rated motor torque [mN m]", write=False),
    Requirement(0x608F, 1, 4, "encoder increments", write=False),
    Requirement(0x608F, 2, 4, "per motor revolutions", write=False),
    Requirement(0x6502, 0, 4, "supported modes", write=False),
)
_BY_UNITS = (0x6065, 0x6085)  # their values are known when the drive has told its encoder
_ANY_UNITS = AxisUnits(1.0, 1.0, 1.0)

Verdict = Literal["red", "allowed", "shown"]


@dataclass(frozen=True, slots=True)
class EdsFinding:
    """One thing that an EDS does not say as it must; `line` 0 where it has no such object.

    Limits that a value is beyond are shown and no more: they are often wrong (0 to 65535 for a
    number of 32 bits), and what a drive does not take is red when it is read back.
    """

    object_name: str
    name: str
    required: str
    found: str
    line: int
    verdict: Verdict = "red"


def eds_findings(
    eds: ElectronicDataSheet, cell: CellConfig, axis: DriveAxis
) -> tuple[EdsFinding, ...]:
    """Return what a drive's data sheet lacks: objects, their size, access and mapping.

    Parameters
    ----------
    eds : ElectronicDataSheet
        The EDS that the axis names.
    cell, axis : CellConfig, DriveAxis
        The cell, and the axis of it. What the drive may lack by `allow_drive_without_watchdog` is
        a finding, but no red one.
    """
    findings: list[EdsFinding] = []
    if eds.node_id is not None and eds.node_id != axis.node_id:
        said = str(eds.node_id)
        findings.append(EdsFinding("[DeviceComissioning]", "node id", f"{axis.node_id}", said, 0))
    allowed = axis.node_id in cell.drive_safety.allow_drive_without_watchdog
    for requirement in (*_READ, *safety_requirements(cell, _ANY_UNITS)):
        found = eds.get(requirement.index, requirement.subindex)
        if found is None and requirement.optional:
            continue
        lack = _lack(requirement, found)
        beyond = _out_of_limits(requirement, found)
        if lack is not None:
            verdict: Verdict = "allowed" if requirement.watchdog and allowed else "red"
            findings.append(_finding(requirement, *lack, found, verdict))
        elif beyond is not None:
            findings.append(_finding(requirement, *beyond, found, "shown"))
    for pdo in cyclic_pdos(axis.node_id, cell.exchange):
        findings += _pdo_findings(eds, pdo)
    return tuple(findings)


def _lack(requirement: Requirement, found: EdsObject | None) -> tuple[str, str] | None:
    """Return what is required and what is found instead; None where all is well."""
    bits = 8 * requirement.size
    required = f"{bits} bit, writable" if _writes(requirement) else f"{bits} bit"
    if found is None:
        return required, "not in the EDS"
    if found.faults:
        return required, f"line {found.faults[0].line}: {found.faults[0].text}"
    if found.bits != bits:
        return required, _type_words(found)
    if _writes(requirement) and not found.writable:
        return required, f"AccessType {found.access or 'not said'}"
    return None


def _out_of_limits(requirement: Requirement, found: EdsObject | None) -> tuple[str, str] | None:
    value = requirement.value
    if found is None or value is None or not requirement.write or requirement.index in _BY_UNITS:
        return None
    if found.data_type is not None and not is_signed(found.data_type):
        value &= (1 << 8 * requirement.size) - 1
    low, high = found.limits
    return None if low <= value <= high else (f"takes {value}", f"limits {low} to {high}")


def _writes(requirement: Requirement) -> bool:
    return requirement.write and requirement.value is not None


def _pdo_findings(eds: ElectronicDataSheet, pdo: PdoMapping) -> Iterator[EdsFinding]:
    title = f"{pdo.direction.upper()} {pdo.number}"
    sizes = {(write.index, write.subindex): len(write.data) for write in pdo.writes()}
    for (index, subindex), size in sizes.items():
        requirement = Requirement(index, subindex, size, f"{title} configuration", 0)
        found = eds.get(index, subindex)
        lack = _lack(requirement, found)
        if lack is not None:
            yield _finding(requirement, *lack, found)
    for item in pdo.objects:
        yield from _mapped_findings(eds, pdo, item, title)


def _mapped_findings(
    eds: ElectronicDataSheet, pdo: PdoMapping, item: MappedObject, title: str
) -> Iterator[EdsFinding]:
    found = eds.get(item.index, item.subindex)
    required = f"{item.bits} bit, mappable"
    requirement = Requirement(item.index, item.subindex, item.bits // 8, f"in {title}")
    if found is None:
        yield _finding(requirement, required, "not in the EDS", None)
    elif found.faults:
        said = f"line {found.faults[0].line}: {found.faults[0].text}"
        yield _finding(requirement, required, said, found)
    elif found.bits != item.bits:
        yield _finding(requirement, required, _type_words(found), found)
    elif not found.mappable:
        yield _finding(requirement, required, "PDOMapping 0", found)
    elif not (found.receivable if pdo.direction == "rpdo" else found.sendable):
        said = f"AccessType {found.access or 'not said'}"
        yield _finding(requirement, required, said, found)


def _finding(
    requirement: Requirement,
    required: str,
    said: str,
    found: EdsObject | None,
    verdict: Verdict = "red",
) -> EdsFinding:
    name = requirement.name
    if found is not None and found.name:
        name = f"{name} ({printable(found.name, 40)})"
    line = 0 if found is None else found.line
    address = object_name(requirement.index, requirement.subindex)
    return EdsFinding(address, name, required, said, line, verdict)


def _type_words(found: EdsObject) -> str:
    if found.data_type is None:
        return "no DataType"
    known = found.data_type in DataType.__members__.values()
    return DataType(found.data_type).name if known else f"DataType {found.data_type:#06x}"
