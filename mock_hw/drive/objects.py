"""The object dictionary of a simulated drive (CiA 301, CiA 402-2)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Literal

from config.cell.cell import CellConfig, DriveAxis
from config.cell.fixed_pdo import FixedPdo, object_address
from config.cell.servo_profile import BY_POSITION, TARGETS, ServoProfile
from config.errors import ConfigError
from config.robot.robot import Joint
from config.simulation.plant import SimulatedAxis
from drivers.canopen.frames import SYNC_COB_ID, emcy_cob_id, rpdo_cob_id, tpdo_cob_id
from drivers.canopen.pdo import (
    INVALID,
    NO_RTR,
    RPDO_COMMUNICATION,
    RPDO_MAPPING,
    TPDO_COMMUNICATION,
    TPDO_MAPPING,
    MappedObject,
)
from drivers.canopen.sdo import object_name
from drivers.servo.cia402 import DRIVE_PROFILE, AxisUnits, MotorRatings
from drivers.servo.requirements import MODES
from drivers.servo.stop_ramp import further_torque_limits
from mock_hw.drive.object_dictionary import Mirror, ObjectEntry

ERROR_REGISTER = (0x1001, 0)
ERROR_HISTORY = 0x1003
SYNC_PERIOD_US = (0x1006, 0)
STORE = (0x1010, 1)
STORES_ON_COMMAND = 1
STORE_WORD = int.from_bytes(b"save", "little")
GUARD_TIME = (0x100C, 0)
LIFE_TIME_FACTOR = (0x100D, 0)
HEARTBEAT_CONSUMER = 0x1016
HEARTBEAT_PRODUCER = (0x1017, 0)
COMMUNICATION_ERROR = (0x1029, 1)
ABORT_CONNECTION = (0x6007, 0)
ERROR_CODE = (0x603F, 0)
CONTROLWORD = (0x6040, 0)
STATUSWORD = (0x6041, 0)
QUICK_STOP_OPTION = (0x605A, 0)
SHUTDOWN_OPTION = (0x605B, 0)
DISABLE_OPERATION_OPTION = (0x605C, 0)
FAULT_REACTION_OPTION = (0x605E, 0)
MODE = (0x6060, 0)
MODE_DISPLAY = (0x6061, 0)
POSITION = (0x6064, 0)
FOLLOWING_ERROR_WINDOW = (0x6065, 0)
FOLLOWING_ERROR_TIME_MS = (0x6066, 0)
VELOCITY = (0x606C, 0)
TORQUE_LIMIT = (0x6072, 0)
TORQUE = (0x6077, 0)
PROFILE_ACCELERATION = (0x6083, 0)
PROFILE_DECELERATION = (0x6084, 0)
QUICK_STOP_DECELERATION = (0x6085, 0)
TORQUE_OFFSET = (0x60B2, 0)
INTERPOLATION_PERIOD = (0x60C2, 1)
INTERPOLATION_INDEX = (0x60C2, 2)
FOLLOWING_ERROR = (0x60F4, 0)
DIGITAL_INPUTS = (0x60FD, 0)
TARGET_VELOCITY = (0x60FF, 0)
TARGET_OF = {MODES[mode]: TARGETS[mode] for mode in BY_POSITION}

ERROR_HISTORY_LENGTH = 8
CONSUMERS = 4
PDO_NUMBERS = (1, 2, 3, 4)
FOLLOWING_ERROR_OFF = 0xFFFF_FFFF

_PRODUCT_CODE = 0x0361
ON_REQUEST = 253
_PDO_TYPES = frozenset((*range(241), 254, 255))
_CIA402 = ServoProfile()
_NM_PER_A = 0.1
_HIGHEST_LIMIT = 6500  # of current and torque [0.1 %]
_LARGEST = 3.0  # torque limit, times the rated torque
_CIA402_AREA = 0x6000
_CODES = {8: "B", 16: "H", 32: "I"}


@dataclass(frozen=True)
class SimulatedIdentity:
    """Fixed properties of one simulated drive: address, motor, encoder, gear and profile.

    Attributes:
        node_id: CANopen node id.
        encoder_increments: Encoder increments per motor revolution (608Fh).
        gear: Motor revolutions per joint revolution (6091h).
        rated_torque_mnm: Rated torque of the motor [mN m].
        profile: Profile of the drive's family, with its objects and units.
        referenced: True if the drive has been homed.
        nm_per_a: Torque constant of the motor [N m/A] if the profile states none; None if unknown.
    """

    node_id: int
    encoder_increments: int
    gear: Fraction
    rated_torque_mnm: int
    profile: ServoProfile = _CIA402
    referenced: bool = True
    nm_per_a: float | None = None

    def __post_init__(self) -> None:
        largest = max(self.gear.numerator, self.gear.denominator)
        if self.gear <= 0 or largest >= 2**32 or self.rated_torque_mnm <= 0:
            raise ConfigError(
                f"node {self.node_id}: gear {self.gear} and rated torque {self.rated_torque_mnm}"
                " mN m cannot be stored in 6091h and 6076h: both must be positive, and the two"
                f" numbers of the gear below {2**32}",
                code="RID-MOCK-RANGE",
            )
        if self.encoder_increments <= 0:
            raise ConfigError(
                f"node {self.node_id}: the encoder has {self.encoder_increments} increments per"
                " revolution; at least 1 is necessary",
                code="RID-MOCK-RANGE",
            )

    @classmethod
    def of_axis(
        cls, cell: CellConfig, axis: DriveAxis, joint: Joint, simulated: SimulatedAxis
    ) -> SimulatedIdentity:
        """Return the properties of the drive for a cell's axis, its joint and its simulated motor.

        The gear ratio of a prismatic joint (rad/m) cannot be stored in 6091h, which then contains
        1:1.
        """
        gear, at_joint = Fraction(1), joint.torque_constant_nm_per_a
        if joint.type == "revolute":
            gear = Fraction(abs(joint.gear_ratio)).limit_denominator(1_000_000)
        return cls(
            axis.node_id,
            simulated.encoder_increments_per_motor_rev,
            gear,
            round(1000.0 * simulated.rated_motor_torque_nm),
            cell.servo_of(axis),
            simulated.referenced,
            at_joint and at_joint / abs(joint.gear_ratio),
        )

    @property
    def referenced_bits(self) -> int:
        """Bits with which the drive reports whether it is referenced; 0 if it has no such bits."""
        if (bits := self.profile.referenced) is None:
            return 0
        return bits.referenced_value if self.referenced else ~bits.referenced_value & bits.mask

    @property
    def motor(self) -> MotorRatings:
        """Ratings of the motor that are stored in the drive."""
        torque = 1e-3 * self.rated_torque_mnm
        current = self.profile.rated_current_a
        constant = self.profile.torque_constant_nm_per_a or self.nm_per_a
        constant = constant or (_NM_PER_A if current is None else torque / current)
        return MotorRatings(self.encoder_increments, torque, current or torque / constant, constant)

    @property
    def units(self) -> AxisUnits:
        """Conversion of the drive's units, at the motor (without gear)."""
        return AxisUnits.of_motor(self.motor, self.profile, 1.0)


def drive_entries(identity: SimulatedIdentity) -> Iterator[ObjectEntry]:
    """Yield all objects of a simulated drive; those that its family does not have are `hidden`.

    Hidden objects are needed because the simulation of the drive uses them.
    """
    profile = identity.profile
    entries = {entry.key: entry for entry in _all_entries(identity)}
    for entry in entries.values():
        name = f"{entry.index:04X}h", f"{entry.index:04X}h:{entry.subindex:02X}"
        if any(each in profile.lacks for each in name):
            yield replace(entry, hidden=True)
        elif name[1] in profile.read_only:
            yield replace(entry, access="ro")
        else:
            yield entry


def _all_entries(identity: SimulatedIdentity) -> Iterator[ObjectEntry]:
    yield from _communication_entries(identity)
    fixed = {pdo.pdo: pdo for pdo in identity.profile.pdos}
    for number in PDO_NUMBERS:
        for entry in _pdo_entries(identity.node_id, number):
            yield entry if not fixed else _with_fixed_pdo(entry, fixed, identity.node_id)
    yield from _profile_entries(identity)
    yield from _manufacturer_entries(identity)
    yield from _channel_entries(identity.profile)


def _with_fixed_pdo(entry: ObjectEntry, fixed: dict[str, FixedPdo], node_id: int) -> ObjectEntry:
    """Return an object of a PDO's records, changed for a drive with fixed PDOs.

    The transmission type of a fixed PDO can be written; its mapping and identifier cannot.
    """
    receives = entry.index & 0xFC00 == RPDO_COMMUNICATION
    number = (entry.index & 0xFF) + 1
    pdo = fixed.get(f"{'r' if receives else 't'}pdo{number}")
    if pdo is None:
        return replace(entry, hidden=True)
    if entry.index in (RPDO_MAPPING + number - 1, TPDO_MAPPING + number - 1):
        held = len(pdo.objects)
        if entry.subindex:
            listed = dict(enumerate(pdo.objects, start=1)).get(entry.subindex)
            held = 0
            if listed is not None:
                held = MappedObject(*object_address(listed.object), listed.bits).entry()
        return replace(entry, default=held, access="ro")
    if entry.subindex == 1:
        cob_id = (rpdo_cob_id if receives else tpdo_cob_id)(node_id, number)
        return replace(entry, default=cob_id, access="ro")
    if entry.subindex == 2 and not receives:
        return replace(entry, default=ON_REQUEST, allowed=_PDO_TYPES | {ON_REQUEST})
    return entry


def _channel_entries(profile: ServoProfile) -> Iterator[ObjectEntry]:
    """Yield the manufacturer-specific objects that are mapped into fixed PDOs."""
    known = {extra.object for extra in profile.settings}
    for pdo in profile.pdos:
        for listed in pdo.objects:
            if object_address(listed.object)[0] < _CIA402_AREA and listed.object not in known:
                known.add(listed.object)
                signed = listed.signal is not None
                code = _CODES[listed.bits].lower() if signed else _CODES[listed.bits]
                access: Literal["ro", "rw"] = "rw" if pdo.receives else "ro"
                mapping: Literal["r", "t"] = "r" if pdo.receives else "t"
                yield ObjectEntry(
                    *object_address(listed.object), "channel", code, 0, access, mapping
                )


def mirrors(profile: ServoProfile) -> Iterator[Mirror]:
    """Yield the rules that connect objects of fixed PDOs with objects of CiA 402.

    A set-point is applied only while the constant objects in its PDO have the values of the
    profile. A measured value is copied only while the profile's `settings` have their required
    values.
    """
    settings = tuple((object_address(each.object), each.value) for each in profile.settings)
    standard = {"target": TARGET_VELOCITY, "position": POSITION, "torque": TORQUE}
    for pdo in profile.pdos:
        held = [(object_address(each.object), each.holds) for each in pdo.objects]
        for listed in pdo.objects:
            key = object_address(listed.object)
            internal = standard.get(listed.signal or "", key)
            if key != internal and pdo.receives:
                conditions = tuple((other, value) for other, value in held if value is not None)
                yield Mirror(internal, key, conditions)
            elif key != internal:
                yield Mirror(key, internal, settings)


def _manufacturer_entries(identity: SimulatedIdentity) -> Iterator[ObjectEntry]:
    """Yield the objects that depend on the drive's family: torque or current, limit, settings."""
    profile, motor = identity.profile, identity.motor
    torque, limit = profile.torque, profile.torque_limit
    if torque.object != object_name(*TORQUE) and not profile.pdos:
        yield ObjectEntry(*object_address(torque.object), "torque or current", "h", 0, mapping="t")
    if limit is not None and limit.object != object_name(*TORQUE_LIMIT):
        code = _CODES[limit.bits]
        access: Literal["ro", "rw"] = "rw" if profile.torque_limit_written else "ro"
        value = min(motor.limit(limit, _LARGEST), (1 << limit.bits) - 1)
        yield ObjectEntry(
            *object_address(limit.object), "torque or current limit", code, value, access
        )
    rated = object_address(profile.rated_current_object)
    milliamperes = min(round(1e3 * (motor.current_a or 0.0)), 2**32 - 1)
    yield ObjectEntry(*rated, "rated current [mA]", "I", milliamperes)
    for name, further in further_torque_limits(profile):
        yield ObjectEntry(*object_address(further.object), name, "H", _HIGHEST_LIMIT, "rw")
    if profile.by_position:
        yield ObjectEntry(*TARGETS[profile.mode], "target position", "i", 0, "rw", "r")
    if profile.by_ramp:
        yield ObjectEntry(*PROFILE_ACCELERATION, "profile acceleration", "I", 10_000_000, "rw")
    for extra in profile.settings:
        code = _CODES[extra.bits].lower() if extra.value < 0 else _CODES[extra.bits]
        value = 0 if extra.written else extra.value
        address = object_address(extra.object)
        yield ObjectEntry(*address, "setting of the drive family", code, value, "rw")
    bits = profile.referenced
    if bits is not None and bits.object != object_name(*STATUSWORD):
        held = identity.referenced_bits
        yield ObjectEntry(*object_address(bits.object), "referenced", _CODES[bits.bits], held)


def _communication_entries(identity: SimulatedIdentity) -> Iterator[ObjectEntry]:
    node_id = identity.node_id
    yield ObjectEntry(0x1000, 0, "device type: servo drive", "I", 0x0002_0000 | DRIVE_PROFILE)
    yield ObjectEntry(*ERROR_REGISTER, "error register", "B", 0, mapping="t")
    yield ObjectEntry(ERROR_HISTORY, 0, "number of errors", "B", 0, "rw", allowed=frozenset((0,)))
    for number in range(1, ERROR_HISTORY_LENGTH + 1):
        yield ObjectEntry(ERROR_HISTORY, number, "error, newest first", "I", 0)
    yield ObjectEntry(0x1005, 0, "SYNC identifier", "I", SYNC_COB_ID)
    yield ObjectEntry(*SYNC_PERIOD_US, "SYNC period [us]", "I", 0, "rw")
    yield ObjectEntry(0x1008, 0, "device name", "s", b"rid-daq simulated servo drive")
    yield ObjectEntry(0x100A, 0, "software version", "s", b"1.0")
    if identity.profile.watch == "life_guarding":
        yield ObjectEntry(*GUARD_TIME, "guard time [ms]", "H", 0, "rw")
        yield ObjectEntry(*LIFE_TIME_FACTOR, "life time factor", "B", 0, "rw")
    yield ObjectEntry(0x1010, 0, "number of storage commands", "B", 1)
    yield ObjectEntry(
        *STORE, "store all parameters", "I", STORES_ON_COMMAND, "rw", "", frozenset((STORE_WORD,))
    )
    yield ObjectEntry(0x1014, 0, "EMCY identifier", "I", emcy_cob_id(node_id))
    yield ObjectEntry(HEARTBEAT_CONSUMER, 0, "number of consumers", "B", CONSUMERS)
    for number in range(1, CONSUMERS + 1):
        yield ObjectEntry(HEARTBEAT_CONSUMER, number, "heartbeat consumer", "I", 0, "rw")
    yield ObjectEntry(*HEARTBEAT_PRODUCER, "heartbeat period [ms]", "H", 0, "rw")
    yield ObjectEntry(0x1018, 0, "identity", "B", 4)
    yield ObjectEntry(0x1018, 1, "vendor", "I", identity.profile.vendor or 0)
    yield ObjectEntry(0x1018, 2, "product", "I", _PRODUCT_CODE)
    yield ObjectEntry(0x1018, 3, "revision", "I", 0x0001_0000)
    yield ObjectEntry(0x1018, 4, "serial number", "I", node_id)
    yield ObjectEntry(0x1029, 0, "error behaviour", "B", 1)
    name = "reaction to a communication error"
    yield ObjectEntry(*COMMUNICATION_ERROR, name, "B", 0, "rw", "", range(3))


def _pdo_entries(node_id: int, number: int) -> Iterator[ObjectEntry]:
    """Yield the objects of one RPDO and one TPDO; after a reset, only number 1 is valid."""
    off = 0 if number == 1 else INVALID
    communication, mapping = RPDO_COMMUNICATION + number - 1, RPDO_MAPPING + number - 1
    yield ObjectEntry(communication, 0, "RPDO", "B", 5)
    yield ObjectEntry(communication, 1, "identifier", "I", rpdo_cob_id(node_id, number) | off, "rw")
    yield ObjectEntry(communication, 2, "transmission type", "B", 255, "rw", "", _PDO_TYPES)
    yield ObjectEntry(communication, 5, "deadline [ms]", "H", 0, "rw")
    yield from _mapping_entries(mapping, CONTROLWORD if number == 1 else None)
    communication, mapping = TPDO_COMMUNICATION + number - 1, TPDO_MAPPING + number - 1
    identifier = tpdo_cob_id(node_id, number) | NO_RTR | off
    yield ObjectEntry(communication, 0, "TPDO", "B", 5)
    yield ObjectEntry(communication, 1, "identifier", "I", identifier, "rw")
    yield ObjectEntry(communication, 2, "transmission type", "B", 255, "rw", "", _PDO_TYPES)
    yield ObjectEntry(communication, 3, "inhibit time [100 us]", "H", 0, "rw")
    yield ObjectEntry(communication, 5, "event timer [ms]", "H", 0, "rw")
    yield from _mapping_entries(mapping, STATUSWORD if number == 1 else None)


def _mapping_entries(index: int, first: tuple[int, int] | None) -> Iterator[ObjectEntry]:
    yield ObjectEntry(
        index, 0, "number of objects", "B", 0 if first is None else 1, "rw", "", range(9)
    )
    default = 0 if first is None else MappedObject(*first, 16).entry()
    for position in range(1, 9):
        yield ObjectEntry(index, position, "object", "I", default if position == 1 else 0, "rw")


def _profile_entries(identity: SimulatedIdentity) -> Iterator[ObjectEntry]:
    ramps = frozenset((0, 1, 2))
    mode = MODES[identity.profile.mode]
    rated = 1e-3 * identity.rated_torque_mnm * identity.profile.rated_torque_units
    quick_stops = frozenset((0, 1, 2, 5, 6))
    yield ObjectEntry(*ABORT_CONNECTION, "abort connection", "h", 1, "rw", "", range(4))
    yield ObjectEntry(*ERROR_CODE, "error code", "H", 0, mapping="t")
    yield ObjectEntry(*CONTROLWORD, "controlword", "H", 0, "rw", "rt")
    yield ObjectEntry(*STATUSWORD, "statusword", "H", 0, mapping="t")
    yield ObjectEntry(*QUICK_STOP_OPTION, "quick-stop reaction", "h", 2, "rw", "", quick_stops)
    yield ObjectEntry(*SHUTDOWN_OPTION, "shutdown reaction", "h", 0, "rw", "", range(2))
    yield ObjectEntry(*DISABLE_OPERATION_OPTION, "disable reaction", "h", 1, "rw", "", range(2))
    yield ObjectEntry(*FAULT_REACTION_OPTION, "fault reaction", "h", 2, "rw", "", ramps)
    yield ObjectEntry(*MODE, "mode", "b", 0, "rw", "r", frozenset((0, mode)))
    yield ObjectEntry(*MODE_DISPLAY, "mode display", "b", 0, mapping="t")
    yield ObjectEntry(*POSITION, "position", "i", 0, mapping="t")
    window = "following-error window"
    yield ObjectEntry(*FOLLOWING_ERROR_WINDOW, window, "I", FOLLOWING_ERROR_OFF, "rw")
    yield ObjectEntry(*FOLLOWING_ERROR_TIME_MS, "following-error time [ms]", "H", 0, "rw")
    yield ObjectEntry(*VELOCITY, "velocity", "i", 0, mapping="t")
    yield ObjectEntry(*TORQUE_LIMIT, "torque limit [0.1 %]", "H", 3000, "rw", "r")
    yield ObjectEntry(0x6076, 0, "rated torque", "I", round(rated))
    torque = identity.profile.torque
    if torque.asked and torque.object == object_name(*TORQUE):
        yield ObjectEntry(*TORQUE, "torque", _CODES[torque.bits].lower(), 0)
    else:
        yield ObjectEntry(*TORQUE, "torque [0.1 %]", "h", 0, mapping="t")
    yield ObjectEntry(*PROFILE_DECELERATION, "profile deceleration", "I", 10_000_000, "rw")
    yield ObjectEntry(*QUICK_STOP_DECELERATION, "quick-stop deceleration", "I", 10_000_000, "rw")
    yield ObjectEntry(0x608F, 0, "encoder resolution", "B", 2)
    yield ObjectEntry(0x608F, 1, "encoder increments", "I", identity.encoder_increments)
    yield ObjectEntry(0x608F, 2, "motor revolutions", "I", 1)
    yield ObjectEntry(0x6091, 0, "gear ratio", "B", 2)
    yield ObjectEntry(0x6091, 1, "motor revolutions", "I", identity.gear.numerator)
    yield ObjectEntry(0x6091, 2, "shaft revolutions", "I", identity.gear.denominator)
    yield ObjectEntry(*TORQUE_OFFSET, "torque offset [0.1 %]", "h", 0, "rw", "r")
    yield ObjectEntry(0x60C2, 0, "interpolation period", "B", 2)
    yield ObjectEntry(
        *INTERPOLATION_PERIOD, "interpolation period", "B", 1, "rw", "", range(1, 256)
    )
    yield ObjectEntry(
        *INTERPOLATION_INDEX, "power of ten of the period [s]", "b", -3, "rw", "", range(-4, -1)
    )
    yield ObjectEntry(*FOLLOWING_ERROR, "following error", "i", 0, mapping="t")
    yield ObjectEntry(*DIGITAL_INPUTS, "digital inputs", "I", 0, mapping="t")
    yield ObjectEntry(*TARGET_VELOCITY, "target velocity", "i", 0, "rw", "rt")
    listed = 1 << mode - 1 if mode > 0 else 0
    yield ObjectEntry(0x6502, 0, "supported modes", "I", listed)
