"""Check of a drive's data sheet against the objects that are used: `EdsFinding`.

The drive itself is not contacted: the check runs before anything is written to it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from config.cell.cell import CellConfig, DriveAxis
from config.cell.fixed_pdo import object_address
from config.cell.servo_profile import ServoProfile
from config.formats.eds import ElectronicDataSheet
from config.formats.eds_object import DataType, EdsObject, is_signed
from drivers.canopen.pdo import COB_ID_MASK, MappedObject, PdoMapping
from drivers.canopen.sdo import object_name
from drivers.device_text import printable
from drivers.servo.cia402 import AxisUnits, MotorRatings
from drivers.servo.motor_ratings import rating_requirements
from drivers.servo.requirements import (
    Requirement,
    cyclic_pdos,
    kind_requirements,
    safety_requirements,
)

_READ = (
    Requirement(0x1001, 0, 1, "error register", write=False),
    Requirement(0x6041, 0, 2, "statusword", write=False),
)
_MODES = 0x6502
_BY_TRIAL = ": the watchdog test must show the reaction"
_BY_UNITS = (0x6065, 0x6083, 0x6084, 0x6085)  # values depend on the drive's encoder
_ANY_MOTOR = MotorRatings(1.0, 1.0, 1.0, 1.0)
_ANY_UNITS = AxisUnits(1.0, 1.0, 1.0, 1.0)

Verdict = Literal["red", "allowed", "shown"]


@dataclass(frozen=True, slots=True)
class EdsFinding:
    """One deviation of an EDS from what rid-daq needs; `line` is 0 if the EDS lacks the object.

    A value beyond the limits in the EDS is shown, but is not red, because such limits are often
    wrong (for example 0 to 65535 for a 32-bit number). If the drive itself does not accept the
    value, the setting becomes red when it is read back.
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
    """Return the deviations of an EDS, such as missing objects, wrong sizes, access or PDO mapping.

    Args:
        eds: The EDS that the axis names.
        cell, axis: The cell, and its axis. A deviation that `allow_drive_without_watchdog` accepts
            has the verdict ``"allowed"``.
    """
    findings: list[EdsFinding] = []
    if eds.node_id is not None and eds.node_id != axis.node_id:
        stated = str(eds.node_id)
        findings.append(EdsFinding("[DeviceComissioning]", "node id", f"{axis.node_id}", stated, 0))
    allowed = axis.node_id in cell.drive_safety.allow_drive_without_watchdog
    profile = cell.servo_of(axis)
    for requirement in (
        *_READ,
        *kind_requirements(profile),
        *rating_requirements(profile),
        *safety_requirements(cell, profile, _ANY_MOTOR, _ANY_UNITS, 1.0),
    ):
        found = eds.get(requirement.index, requirement.subindex)
        if requirement.lack == "shown" and (
            found is None or _only_of_another_size(requirement, found)
        ):
            continue
        lack = _deviation(requirement, found)
        beyond = _out_of_limits(requirement, found)
        if lack is not None:
            by_trial = found is None and requirement.lack == "trial"
            excused: Verdict = "allowed" if requirement.watchdog and allowed else "red"
            verdict = "shown" if by_trial and excused == "red" else excused
            findings.append(_finding(requirement, *lack, found, verdict))
        elif beyond is not None:
            findings.append(_finding(requirement, *beyond, found, "shown"))
    findings += _unknown_ratings(profile)
    for pdo in cyclic_pdos(axis.node_id, cell.exchange, profile):
        findings += _pdo_findings(eds, pdo, axis.node_id)
    if profile.torque.asked:
        torque = Requirement(
            *object_address(profile.torque.object), profile.torque.bits // 8, "torque, by SDO"
        )
        found = eds.get(torque.index, torque.subindex)
        lack = _deviation(torque, found)
        if lack is not None:
            findings.append(_finding(torque, *lack, found))
    if profile.referenced is not None:
        bits = Requirement(
            *object_address(profile.referenced.object), profile.referenced.bits // 8, "referenced"
        )
        found = eds.get(bits.index, bits.subindex)
        lack = _deviation(bits, found)
        if lack is not None:
            findings.append(_finding(bits, *lack, found))
    return tuple(findings)


def _only_of_another_size(requirement: Requirement, found: EdsObject) -> bool:
    """Return True if an optional object that is only read has another size than required."""
    sized = found.bits is not None and not found.faults and found.bits != 8 * requirement.size
    return sized and not requirement.written and requirement.index != _MODES


def _unknown_ratings(profile: ServoProfile) -> Iterator[EdsFinding]:
    """Yield a finding if neither drive nor cell file states the encoder or the torque constant."""
    if profile.encoder_increments is None and profile.sets_increments:
        stated = "the profile sets it, and encoder_increments is not in the cell file"
        yield EdsFinding("608Fh:01", "encoder increments", "stated", stated, 0)
    rated = profile.rated_torque_nm is not None and profile.rated_current_a is not None
    known = rated or profile.torque_constant_nm_per_a is not None
    if profile.torque.of != "rated_torque" and not known:
        stated = "a current, and torque_constant_nm_per_a is not in the cell file"
        yield EdsFinding(profile.torque.object, "torque of the motor", "in N m", stated, 0)


def _deviation(
    requirement: Requirement, found: EdsObject | None, node_id: int = 0
) -> tuple[str, str] | None:
    """Return requirement and deviation of an object in words; None if it is as required.

    A read-only object is accepted if its factory value is the required one.
    """
    bits = 8 * requirement.size
    required = f"{bits} bit, writable" if requirement.written else f"{bits} bit"
    if found is None:
        return required, "not in the EDS" + _BY_TRIAL * (requirement.lack == "trial")
    if found.faults:
        return required, f"line {found.faults[0].line}: {found.faults[0].text}"
    if found.bits != bits:
        return required, _type_words(found)
    if (
        requirement.written
        and not found.writable
        and not _is_factory_right(requirement, found, node_id)
    ):
        return required, f"AccessType {found.access or 'not stated'}"
    if (
        requirement.index == _MODES
        and _factory_value(found)
        and not _is_factory_right(requirement, found)
    ):
        return requirement.name, f"{_factory_value(found):X}h does not list this mode"
    return None


def _factory_value(found: EdsObject, node_id: int = 0) -> int:
    """Return an object's factory value in the EDS; 0 if the EDS does not state it."""
    content = 0 if found.default is None else found.default.of_node(node_id)
    return content if isinstance(content, int) else 0


def _is_factory_right(requirement: Requirement, found: EdsObject, node_id: int = 0) -> bool:
    mask = requirement.mask & (1 << 8 * requirement.size) - 1
    is_stated = found.default is not None
    return is_stated and not (_factory_value(found, node_id) ^ (requirement.value or 0)) & mask


def _out_of_limits(requirement: Requirement, found: EdsObject | None) -> tuple[str, str] | None:
    value = requirement.value
    if found is None or value is None or not requirement.write or requirement.index in _BY_UNITS:
        return None
    if found.data_type is not None and not is_signed(found.data_type):
        value &= (1 << 8 * requirement.size) - 1
    low, high = found.limits
    return None if low <= value <= high else (f"accepts {value}", f"limits {low} to {high}")


def _pdo_findings(eds: ElectronicDataSheet, pdo: PdoMapping, node_id: int) -> Iterator[EdsFinding]:
    title = f"{pdo.direction.upper()} {pdo.number}"
    last = {(write.index, write.subindex): write.data for write in pdo.writes()}
    for (index, subindex), data in last.items():
        value = int.from_bytes(data, "little")
        mask = COB_ID_MASK if (index, subindex) == (pdo.communication_index, 1) else -1
        name = f"{title} configuration"
        requirement = Requirement(index, subindex, len(data), name, value, mask=mask)
        found = eds.get(index, subindex)
        lack = _deviation(requirement, found, node_id)
        if lack is not None:
            yield _finding(requirement, *lack, found)
    if pdo.fixed:
        yield from _fixed_findings(eds, pdo, title)
        return
    for item in pdo.objects:
        yield from _mapped_findings(eds, pdo, item, title)


def _fixed_findings(eds: ElectronicDataSheet, pdo: PdoMapping, title: str) -> Iterator[EdsFinding]:
    """Yield the mapped objects of a fixed PDO that differ between EDS and profile."""
    for held in pdo.read_back():
        if held.index != pdo.mapping_index:
            continue
        value = int.from_bytes(held.data, "little")
        requirement = Requirement(held.index, held.subindex, len(held.data), f"{title} object",
                                  value, write=False, hexadecimal=True)  # fmt: skip
        found = eds.get(held.index, held.subindex)
        required = requirement.words(value)
        if found is None:
            yield _finding(requirement, required, "not in the EDS", None)
        elif not _is_factory_right(requirement, found):
            yield _finding(requirement, required, requirement.words(_factory_value(found)), found)


def _mapped_findings(
    eds: ElectronicDataSheet, pdo: PdoMapping, item: MappedObject, title: str
) -> Iterator[EdsFinding]:
    found = eds.get(item.index, item.subindex)
    required = f"{item.bits} bit, mappable"
    requirement = Requirement(item.index, item.subindex, item.bits // 8, f"in {title}")
    if found is None:
        yield _finding(requirement, required, "not in the EDS", None)
    elif found.faults:
        stated = f"line {found.faults[0].line}: {found.faults[0].text}"
        yield _finding(requirement, required, stated, found)
    elif found.bits != item.bits:
        yield _finding(requirement, required, _type_words(found), found)
    elif not found.mappable:
        yield _finding(requirement, required, "PDOMapping 0", found)
    elif not (found.receivable if pdo.direction == "rpdo" else found.sendable):
        stated = f"AccessType {found.access or 'not stated'}"
        yield _finding(requirement, required, stated, found)


def _finding(
    requirement: Requirement,
    required: str,
    stated: str,
    found: EdsObject | None,
    verdict: Verdict = "red",
) -> EdsFinding:
    name = requirement.name
    if found is not None and found.name:
        name = f"{name} ({printable(found.name, 40)})"
    line = 0 if found is None else found.line
    address = object_name(requirement.index, requirement.subindex)
    return EdsFinding(address, name, required, stated, line, verdict)


def _type_words(found: EdsObject) -> str:
    if found.data_type is None:
        return "no DataType"
    known = found.data_type in DataType.__members__.values()
    return DataType(found.data_type).name if known else f"DataType {found.data_type:#06x}"
