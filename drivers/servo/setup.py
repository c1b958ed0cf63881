"""`DriveSetup`: what one drive must be told before motion, written and read back.

A drive without a watch on this computer (1016h, 6007h) is refused unless the cell file names it in
allow_drive_without_watchdog.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

from config.cell.cell import CellConfig, DeviceIdentity, DriveAxis
from config.robot.robot import Joint
from drivers.canopen.emcy import code_text
from drivers.canopen.frames import Frame
from drivers.canopen.pdo import (
    INVALID,
    PREDEFINED_NUMBERS,
    RPDO_COMMUNICATION,
    TPDO_COMMUNICATION,
    PdoMapping,
    is_valid,
)
from drivers.canopen.sdo import SdoAbort, abort_text, object_name
from drivers.device_text import printable
from drivers.interfaces.servo_axes import DriveSetting
from drivers.ports.can_link import CanLink
from drivers.servo.cia402 import (
    CYCLIC_SYNCHRONOUS_VELOCITY,
    DRIVE_PROFILE,
    AxisUnits,
    PowerState,
    state_of,
)
from drivers.servo.requirements import (
    Requirement,
    cyclic_pdos,
    identity_requirement,
    safety_requirements,
)
from drivers.servo.sdo_port import SdoPort, is_missing
from drivers.servo.stop_ramp import stop_settings
from drivers.settings.write_log import WriteLog

GEAR_TOLERANCE = 1e-4
_COB_ID_MASK = INVALID | 0x7FF

Verdict = Literal["ok", "red", "allowed", "shown"]


@dataclass(frozen=True, slots=True)
class SetupResult:
    """What was found out about one drive; `units` is None where they could not be read."""

    joint: str
    units: AxisUnits | None
    settings: tuple[DriveSetting, ...]


class DriveSetup:
    """Configures one drive over SDO and collects what it found; nothing it reads is trusted.

    A refused or ignored write shows as a red setting and the rest is still done, so that one run
    names everything that is wrong. Only a drive that stops answering, or a lost bus, raises.

    Parameters
    ----------
    link : CanLink
        The bus.
    axis, joint, cell : DriveAxis, Joint, CellConfig
        The drive, the joint that it moves and the cell's limits.
    others : callable
        Takes the frames that are not this drive's SDO answers, with their time [s].
    write_log : WriteLog, optional
        Where what is written is kept, with what was there.
    """

    def __init__(
        self,
        link: CanLink,
        axis: DriveAxis,
        joint: Joint,
        cell: CellConfig,
        others: Callable[[Frame, float], None],
        write_log: WriteLog | None = None,
    ) -> None:
        self._axis = axis
        self._joint = joint
        self._cell = cell
        self._port = SdoPort(link, axis.node_id, others, write_log=write_log)
        self._settings: list[DriveSetting] = []
        self._held: dict[tuple[int, int], int] = {}

    def run(self) -> SetupResult:
        """Identify, configure and read back the drive.

        Nothing is written to one that is another than the cell file or its data sheet says.

        Raises
        ------
        DeviceTimeoutError
            The drive stopped answering.
        TransportError
            The bus is gone.
        """
        self._identify()
        if not self._is_expected():
            return SetupResult(self._axis.joint, None, tuple(self._settings))
        units = self._read_units()
        if units is not None:
            for requirement in safety_requirements(self._cell, units):
                self._require(requirement)
            self._settings += stop_settings(self._cell, self._axis, self._joint, units, self._held)
            pdos = cyclic_pdos(self._axis.node_id, self._cell.exchange)
            for pdo in pdos:
                self._configure_pdo(pdo)
            self._switch_off_other_pdos({pdo.communication_index for pdo in pdos})
        self._check_state()
        return SetupResult(self._axis.joint, units, tuple(self._settings))

    def _identify(self) -> None:
        self._require(
            Requirement(0x1000, 0, 4, "device profile", DRIVE_PROFILE, mask=0xFFFF, write=False)
        )
        try:
            name = printable(self._port.read(0x1008, 0).rstrip(b"\0"))
        except SdoAbort as abort:
            name = abort_text(abort.code)
        self._note(0x1008, 0, "device name", "", name, "shown")
        csv = 1 << CYCLIC_SYNCHRONOUS_VELOCITY - 1
        self._require(
            Requirement(
                0x6502,
                0,
                4,
                "supports cyclic synchronous velocity",
                csv,
                mask=csv,
                write=False,
                hexadecimal=True,
            )
        )

    def _is_expected(self) -> bool:
        """Read 1018h; return whether it is as the cell file, or the drive's EDS, says."""
        wanted = self._axis.identity or DeviceIdentity()
        begun = len(self._settings)
        for subindex, text, value in (
            (1, "vendor", wanted.vendor),
            (2, "product", wanted.product),
            (3, "revision", None),
            (4, "serial number", None),
        ):
            self._require(identity_requirement(subindex, text, value))
        if wanted.revision is not None:
            text = "revision, upper 16 bits"
            self._require(identity_requirement(3, text, wanted.revision, mask=0xFFFF_0000))
        return all(setting.verdict != "red" for setting in self._settings[begun:])

    def _read_units(self) -> AxisUnits | None:
        increments = self._positive(0x608F, 1, "encoder increments")
        revolutions = self._positive(0x608F, 2, "per motor revolutions")
        rated_torque = self._positive(0x6076, 0, "rated motor torque [mN m]")
        gear = self._gear_ratio()
        if increments is None or revolutions is None or rated_torque is None or gear is None:
            return None
        return AxisUnits.from_drive(
            encoder_increments=increments,
            encoder_motor_revolutions=revolutions,
            gear_ratio=gear,
            rated_torque_mnm=rated_torque,
            direction=self._axis.direction,
            velocity_unit=self._axis.velocity_unit,
            zero_counts=self._axis.position_zero_counts,
        )

    def _positive(self, index: int, subindex: int, name: str) -> int | None:
        try:
            value = self._port.read_int(index, subindex)
        except SdoAbort as abort:
            self._note(index, subindex, name, "a number", abort_text(abort.code), "red")
            return None
        good = value > 0
        self._note(
            index, subindex, name, "" if good else "above 0", str(value), "shown" if good else "red"
        )
        return value if good else None

    def _gear_ratio(self) -> float | None:
        """Return motor per joint revolutions: the robot file's, checked against 6091h.

        A drive that says 1:1, or has no 6091h, does not know the gear; a prismatic joint's ratio
        (rad/m) cannot stand there at all.
        """
        wanted = abs(self._joint.gear_ratio)
        try:
            motor, shaft = self._port.read_int(0x6091, 1), self._port.read_int(0x6091, 2)
        except SdoAbort as abort:
            if not is_missing(abort):
                self._note(0x6091, 0, "gear ratio", "", abort_text(abort.code), "red")
                return None
            self._note(0x6091, 0, "gear ratio", "", "not in this drive", "shown")
            return wanted
        found = f"{motor}:{shaft}"
        if motor == shaft or self._joint.type == "prismatic":
            self._note(0x6091, 0, "gear ratio", "", found, "shown")
            return wanted
        good = motor > 0 and shaft > 0 and abs(motor / shaft / wanted - 1.0) <= GEAR_TOLERANCE
        self._note(0x6091, 0, "gear ratio", f"{wanted:.10g}", found, "ok" if good else "red")
        return motor / shaft if good else None

    def _require(self, requirement: Requirement) -> None:
        """Write an object where it is to be written, read it back and judge it."""
        r = requirement
        refusal = ""
        if r.write and r.value is not None:
            try:
                self._port.write(r.index, r.subindex, r.encoded(r.value))
            except SdoAbort as abort:
                refusal = f" (write refused: {abort_text(abort.code)})"
        required = "" if r.value is None else r.words(r.value & r.mask)
        try:
            found = self._port.read_int(r.index, r.subindex, signed=r.signed)
        except SdoAbort as abort:
            verdict: Verdict = "shown" if r.optional and is_missing(abort) else self._fault(r)
            text = "not in this drive" if is_missing(abort) else abort_text(abort.code)
            self._note(r.index, r.subindex, r.name, required, text, verdict)
            return
        self._held[r.index, r.subindex] = found
        if r.value is None:
            verdict = "shown"
        else:
            verdict = "ok" if found & r.mask == r.value & r.mask else self._fault(r)
        wrong = refusal if verdict != "ok" else ""
        self._note(r.index, r.subindex, r.name, required, r.words(found & r.mask) + wrong, verdict)

    def _fault(self, requirement: Requirement) -> Verdict:
        allowed = self._axis.node_id in self._cell.drive_safety.allow_drive_without_watchdog
        return "allowed" if requirement.watchdog and allowed else "red"

    def _configure_pdo(self, pdo: PdoMapping) -> None:
        title = f"{pdo.direction.upper()} {pdo.number}"
        for write in pdo.writes():
            try:
                self._port.write(write.index, write.subindex, write.data)
            except SdoAbort as abort:
                wanted = write.data[::-1].hex().upper() + "h"
                found = f"refused: {abort_text(abort.code)}"
                self._note(write.index, write.subindex, f"{title} mapping", wanted, found, "red")
                return
        for held in pdo.read_back():
            is_cob_id = (held.index, held.subindex) == (pdo.communication_index, 1)
            self._require(
                Requirement(
                    held.index,
                    held.subindex,
                    len(held.data),
                    f"{title} {_pdo_part(pdo, held.index, held.subindex)}",
                    int.from_bytes(held.data, "little"),
                    write=False,
                    mask=_COB_ID_MASK if is_cob_id else -1,
                    hexadecimal=True,
                )
            )

    def _switch_off_other_pdos(self, used: set[int]) -> None:
        """Switch off what is not used: the bus load is computed without it."""
        for index in _other_pdos(used):
            try:
                entry = self._port.read_int(index, 1)
                if is_valid(entry):
                    self._port.write(index, 1, (entry | INVALID).to_bytes(4, "little"))
                    entry = self._port.read_int(index, 1)
            except SdoAbort as abort:
                if is_missing(abort):
                    continue
                self._note(index, 1, "unused PDO", "off", abort_text(abort.code), "red")
                continue
            if is_valid(entry):
                self._note(index, 1, "unused PDO", "off", f"{entry:X}h", "red")

    def _check_state(self) -> None:
        """Refuse a drive in fault: a person must reset it. What it says of itself is shown."""
        self._require(Requirement(0x1001, 0, 1, "error register", hexadecimal=True))
        try:
            state = state_of(self._port.read_int(0x6041, 0))
            last = self._port.read_int(0x603F, 0) if state is PowerState.FAULT else 0
        except SdoAbort as abort:
            self._note(0x6041, 0, "state", "no fault", abort_text(abort.code), "red")
            return
        text = f"{state.words}: {code_text(last)} ({last:04X}h)" if state.faulty else state.words
        self._note(0x6041, 0, "state", "no fault", text, "red" if state.faulty else "ok")

    def _note(
        self,
        index: int,
        subindex: int,
        name: str,
        required: str,
        found: str,
        verdict: Verdict,
    ) -> None:
        self._settings.append(
            DriveSetting(
                self._axis.joint,
                self._axis.node_id,
                object_name(index, subindex),
                name,
                required,
                found,
                verdict,
            )
        )


def _other_pdos(used: set[int]) -> Iterator[int]:
    for number in PREDEFINED_NUMBERS:
        for family in (RPDO_COMMUNICATION, TPDO_COMMUNICATION):
            if (index := family + number - 1) not in used:
                yield index


def _pdo_part(pdo: PdoMapping, index: int, subindex: int) -> str:
    if index == pdo.mapping_index:
        return f"object {subindex}" if subindex else "number of objects"
    return {1: "identifier", 2: "transmission type", 5: "event timer [ms]"}[subindex]
