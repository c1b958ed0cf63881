"""`DriveSetup`: writes the settings of one drive before motion and reads them back.

A drive must monitor this computer: by 1016h and 6007h, or by life guarding. If an object that
defines its reaction is missing, the watchdog test shows the reaction. A drive that does not monitor
this computer is refused unless the cell file names it in allow_drive_without_watchdog.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

from config.cell.cell import CellConfig, DeviceIdentity, DriveAxis
from config.cell.fixed_pdo import object_address
from config.cell.servo_profile import FEWEST_INCREMENTS
from config.errors import ConfigError
from config.robot.robot import Joint
from drivers.canopen.emcy import code_text
from drivers.canopen.frames import Frame
from drivers.canopen.pdo import (
    COB_ID_MASK,
    INVALID,
    PREDEFINED_NUMBERS,
    RPDO_COMMUNICATION,
    TPDO_COMMUNICATION,
    PdoMapping,
    is_valid,
)
from drivers.canopen.sdo import SdoAbort, SdoCode, abort_text, object_name
from drivers.device_text import printable
from drivers.interfaces.servo_axes import DriveSetting
from drivers.ports.can_link import CanLink
from drivers.servo.cia402 import (
    AxisUnits,
    MotorRatings,
    PowerState,
    state_of,
)
from drivers.servo.motor_ratings import (
    compare_stated_ratings,
    compare_torque_constants,
    position_scale_setting,
    rating_requirements,
    ratings_of,
    torque_setting,
)
from drivers.servo.position_counter import counter_setting, read_counter, reference_setting
from drivers.servo.requirements import (
    INCREMENTS,
    LIFE_TIME_FACTOR,
    Requirement,
    cyclic_pdos,
    identity_requirement,
    kind_requirements,
    safety_requirements,
)
from drivers.servo.sdo_port import SdoPort, explain_abort, is_missing
from drivers.servo.stop_ramp import QUICK_STOP_DECELERATION, stop_settings
from drivers.settings.write_log import WriteLog

GEAR_TOLERANCE = 1e-4

Verdict = Literal["ok", "red", "allowed", "shown"]


@dataclass(frozen=True, slots=True)
class SetupResult:
    """Result of one drive's setup; `units` is None if they could not be determined.

    `undefined_reactions` lists objects that would define the drive's reactions to a failure but are
    missing in the drive; if life guarding is used, its object is listed too. Only the watchdog test
    shows how the drive reacts.
    """

    joint: str
    units: AxisUnits | None
    settings: tuple[DriveSetting, ...]
    undefined_reactions: tuple[str, ...] = ()


class DriveSetup:
    """Configures one drive by SDO and collects the results; every written value is read back.

    If the drive refuses or ignores a write, the setting is red and the setup continues, so that one
    run shows every problem. An error is raised only if the drive stops answering, the bus is lost,
    or a write cannot be logged.

    Args:
        link: The bus.
        axis, joint, cell: The drive, the joint that it moves, and the cell with the limits.
        reach: Lowest and highest position of the drive's motor, divided by the gear ratio [rad or
            m].
        others: Handler of frames that are not this drive's SDO answers, with their time [s].
        write_log: Log of the values that are written by SDO, with the previous values.
    """

    def __init__(
        self,
        link: CanLink,
        axis: DriveAxis,
        joint: Joint,
        cell: CellConfig,
        reach: tuple[float, float],
        others: Callable[[Frame, float], None],
        write_log: WriteLog | None = None,
    ) -> None:
        self._axis = axis
        self._joint = joint
        self._cell = cell.model_copy(update={"drive_safety": cell.safety_of(axis)})
        self._reach = reach
        self._profile = cell.servo_of(axis)
        self._undefined_reactions: list[str] = []
        if self._profile.watch == "life_guarding":  # each manufacturer defines the reaction
            self._undefined_reactions.append(object_name(*LIFE_TIME_FACTOR))
        self._port = SdoPort(link, axis.node_id, others, write_log=write_log)
        self._settings: list[DriveSetting] = []
        self._values: dict[tuple[int, int], int] = {}

    def run(self) -> SetupResult:
        """Identify the drive, write its settings and read them back.

        Nothing is written if the drive's identity differs from that in the cell file or its EDS.

        Raises:
            DeviceTimeoutError: The drive stopped answering.
            TransportError: The bus is lost.
            RecordingError: The write log cannot be written.
        """
        self._identify()
        if not self._is_expected():
            return self._result(None)
        motor, units = self._read_units()
        if motor is not None and units is not None:
            self._configure(motor, units)
        self._settings.append(reference_setting(self._port, self._axis, self._profile.referenced))
        self._check_state()
        return self._result(units)

    def _result(self, units: AxisUnits | None) -> SetupResult:
        return SetupResult(
            self._axis.joint, units, tuple(self._settings), tuple(self._undefined_reactions)
        )

    def _configure(self, motor: MotorRatings, units: AxisUnits) -> None:
        axis, joint = self._axis, self._joint
        steepest = joint.limits.acceleration
        for requirement in safety_requirements(self._cell, self._profile, motor, units, steepest):
            self._require(requirement)
        if self._profile.deceleration_rad_s2 is not None:
            found_text = f"{self._profile.deceleration_rad_s2:g} rad/s² or m/s², from the cell file"
            self._note(*QUICK_STOP_DECELERATION, "quick-stop deceleration", "", found_text, "shown")
        self._settings += stop_settings(self._cell, axis, joint, motor, units, self._values)
        if self._profile.torque.asked:
            torque = object_address(self._profile.torque.object)
            found_text = "read by SDO once in every cycle, after SYNC"
            self._note(*torque, "torque", "", found_text, "shown")
        pdos = cyclic_pdos(axis.node_id, self._cell.exchange, self._profile)
        for pdo in pdos:
            self._configure_pdo(pdo)
        self._switch_off_other_pdos({pdo.communication_index for pdo in pdos})

    def _identify(self) -> None:
        device, *modes = kind_requirements(self._profile)
        self._require(device)
        try:
            name = printable(self._port.read(0x1008, 0).rstrip(b"\0"))
        except SdoAbort as abort:
            name = abort_text(abort.code)
        self._note(0x1008, 0, "device name", "", name, "shown")
        for requirement in modes:
            self._require(requirement)

    def _is_expected(self) -> bool:
        """Read 1018h; return True if it agrees with the identity in the cell file or the EDS."""
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

    def _read_units(self) -> tuple[MotorRatings | None, AxisUnits | None]:
        wanted = rating_requirements(self._profile)
        known = [self._positive(requirement) for requirement in wanted if requirement.value is None]
        self._settings += compare_stated_ratings(self._port, self._axis, self._profile)
        if self._profile.encoder_increments is None and all(known):
            known.append(self._describes_encoder())
        gear = self._gear_ratio()
        if gear is None or not all(known):
            return None, None
        motor = ratings_of(self._profile, self._values)
        scale = position_scale_setting(
            self._port, self._axis, self._profile, motor.increments, gear
        )
        if scale is not None:
            self._settings.append(scale)
        try:
            units = AxisUnits.of_motor(
                motor, self._profile, gear, self._axis.direction, self._axis.position_zero_counts
            )
        except ConfigError as error:
            torque = object_address(self._profile.torque.object)
            self._note(*torque, "torque of the motor", "in N m", str(error), "red")
            return None, None
        rated_nm = motor.rated_nm_by(self._profile.torque)
        if rated_nm is not None:
            at_joint = rated_nm * abs(gear)
            self._settings.append(torque_setting(self._axis, self._joint, rated_nm, at_joint))
        self._settings += compare_torque_constants(
            self._port, self._axis, self._joint, self._profile, gear
        )
        return motor, self._with_counter(units)

    def _with_counter(self, units: AxisUnits) -> AxisUnits:
        """Return the units with the range of 6064h and the middle of the motor's range [counts]."""
        counter = read_counter(self._port)
        ends = [units.counts_per_rad * end for end in self._reach]
        if counter.is_smaller_than_32_bits:
            needed = abs(ends[1] - ends[0])
            self._settings.append(counter_setting(self._axis, counter, needed))
        return replace(units, counter=counter, middle_counts=round(0.5 * sum(ends)))

    def _describes_encoder(self) -> bool:
        """Return True if 608Fh describes the encoder; drives with scaled units may report 1."""
        increments = ratings_of(self._profile, self._values).increments
        good = increments >= FEWEST_INCREMENTS and not self._profile.sets_increments
        if not good:
            required = f"≥ {FEWEST_INCREMENTS:g}, those of the encoder"
            self._note(*INCREMENTS, "increments per revolution", required, f"{increments:g}", "red")
        return good

    def _positive(self, requirement: Requirement) -> bool:
        """Read a value that must be above 0; return True if it is."""
        index, subindex, name = requirement.index, requirement.subindex, requirement.name
        try:
            value = self._port.read_int(index, subindex)
        except SdoAbort as abort:
            self._note(index, subindex, name, "a number", explain_abort(abort), "red")
            return False
        self._values[index, subindex] = value
        good = value > 0
        self._note(
            index, subindex, name, "" if good else "above 0", str(value), "shown" if good else "red"
        )
        return good

    def _gear_ratio(self) -> float | None:
        """Return the robot file's gear ratio; None if 6091h contradicts it or cannot be read.

        The ratio is motor revolutions per joint revolution. A drive that reports 1:1, or has no
        6091h, does not know the gear. The ratio of a prismatic joint (rad/m) cannot be stored in
        6091h, which is then not compared.
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
        """Write an object if required, read it back and compare it."""
        r = requirement
        refusal = ""
        if r.write and r.value is not None:
            try:
                self._port.write(r.index, r.subindex, r.encode(r.value))
            except SdoAbort as abort:
                refusal = f" (write refused: {abort_text(abort.code)})"
        required = "" if r.value is None else r.words(r.value & r.mask)
        try:
            found = self._port.read_int(r.index, r.subindex, signed=r.signed)
        except SdoAbort as abort:
            verdict = self._fault(r)
            text = explain_abort(abort)
            if is_missing(abort) and r.lack != "red" and verdict == "red":
                verdict = "shown"
                if r.lack == "trial":
                    self._undefined_reactions.append(object_name(r.index, r.subindex))
                    text += ": the watchdog test must show the reaction"
            self._note(r.index, r.subindex, r.name, required, text, verdict)
            return
        self._values[r.index, r.subindex] = found
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
                if abort.code == SdoCode.READ_ONLY and write.index == pdo.communication_index:
                    continue  # the value that is read back from the drive is compared
                wanted = write.data[::-1].hex().upper() + "h"
                found = f"refused: {abort_text(abort.code)}"
                self._note(write.index, write.subindex, f"{title} mapping", wanted, found, "red")
                return
        for held in pdo.read_back():
            self._require(
                Requirement(
                    held.index,
                    held.subindex,
                    len(held.data),
                    f"{title} {pdo.part_name(held.index, held.subindex)}",
                    int.from_bytes(held.data, "little"),
                    write=False,
                    mask=COB_ID_MASK if pdo.is_identifier(held) else -1,
                    hexadecimal=True,
                )
            )

    def _switch_off_other_pdos(self, used: set[int]) -> None:
        """Switch off unused PDOs, because the computed bus load does not contain them."""
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
        """Check the power state, and show the error register; a user must reset a fault."""
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
