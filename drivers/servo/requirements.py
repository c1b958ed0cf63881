"""Values that a drive needs before motion: `Requirement`, the safety settings and the PDOs.

If this computer fails, each drive stops itself: its heartbeat consumer (1016h) detects the failure,
and abort connection (6007h) defines the reaction. The event timer of the RPDO (1400h:05) is a
second protection, in drives that have it. A drive without 1016h can have life guarding instead
(100Ch, 100Dh); its effect is always tested before a motion.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Literal

from config.cell.cell import CellConfig
from config.cell.cycle_time import interpolation_period
from config.cell.fixed_pdo import FixedPdo, Signal, object_address, object_of
from config.cell.servo_profile import TARGETS, Mode, ServoProfile
from config.errors import ConfigError
from drivers.canopen.frames import rpdo_cob_id, tpdo_cob_id
from drivers.canopen.heartbeat import consumer_entry
from drivers.canopen.pdo import EVERY_SYNC, ON_EVENT, RPDO_COMMUNICATION, MappedObject, PdoMapping
from drivers.canopen.sdo import object_name
from drivers.servo.cia402 import (
    CYCLIC_SYNCHRONOUS_POSITION,
    CYCLIC_SYNCHRONOUS_VELOCITY,
    DRIVE_PROFILE,
    INTERPOLATED_POSITION,
    MAKERS_OWN,
    PROFILE_VELOCITY,
    AxisUnits,
    MotorRatings,
)
from drivers.servo.stop_ramp import (
    PROFILE_DECELERATION,
    QUICK_STOP_DECELERATION,
    further_torque_limits,
    uses_profile_deceleration,
)

STATUS_EVENT_MS = 100
MODES: Final[dict[Mode, int]] = {
    "cyclic_velocity": CYCLIC_SYNCHRONOUS_VELOCITY,
    "profile_velocity": PROFILE_VELOCITY,
    "cyclic_position": CYCLIC_SYNCHRONOUS_POSITION,
    "interpolated_position": INTERPOLATED_POSITION,
    "makers": MAKERS_OWN,
}
INCREMENTS, REVOLUTIONS = (0x608F, 1), (0x608F, 2)
GUARD_TIME, LIFE_TIME_FACTOR = (0x100C, 0), (0x100D, 0)
RATED_TORQUE = (0x6076, 0)

_MILLI = 1000.0
_STEEPER = 4.0
"""Acceleration of a drive's own ramp to a set-point, as a multiple of the joint's acceleration
limit: the ramp must not limit the motion."""


@dataclass(frozen=True, slots=True)
class Requirement:
    """An object with its required value; if `value` is None, the object is only read and shown.

    If `write` is False, the value is checked but not written. If `watchdog` is True, the cell file
    can accept a wrong value (allow_drive_without_watchdog). `lack` is the result if the drive does
    not have the object: ``"red"``, ``"shown"``, or ``"trial"``: the watchdog test must show how the
    drive reacts without the object.
    """

    index: int
    subindex: int
    size: int
    name: str
    value: int | None = None
    signed: bool = False
    lack: Literal["red", "shown", "trial"] = "red"
    watchdog: bool = False
    write: bool = True
    mask: int = -1
    hexadecimal: bool = False

    @property
    def written(self) -> bool:
        """True if the value is written to the drive."""
        return self.write and self.value is not None

    def words(self, value: int) -> str:
        """Return a value in decimal or hexadecimal text."""
        return f"{value & (1 << 8 * self.size) - 1:X}h" if self.hexadecimal else str(value)

    def encode(self, value: int) -> bytes:
        """Return a value as bytes.

        Raises:
            ConfigError: The value does not fit into `size` bytes.
        """
        try:
            return value.to_bytes(self.size, "little", signed=self.signed)
        except OverflowError:
            raise ConfigError(
                f"{self.name}: {value} in the cell file does not fit the"
                f" {8 * self.size} bits of {self.index:04X}h; correct the cell file",
                code="RID-SERVO-VALUE",
            ) from None


def identity_requirement(
    subindex: int, name: str, value: int | None, mask: int = -1
) -> Requirement:
    """Return the requirement on a part of 1018h (identity); None as `value` accepts any value."""
    return Requirement(
        0x1018,
        subindex,
        4,
        name,
        value,
        lack="shown" if value is None else "red",
        write=False,
        mask=mask,
        hexadecimal=True,
    )


def mode_words(mode: Mode) -> str:
    """Return a mode's name, such as cyclic synchronous velocity."""
    return mode.replace("cyclic_", "cyclic synchronous ").replace("_", " ")


def kind_requirements(profile: ServoProfile) -> tuple[Requirement, ...]:
    """Return the requirements that a device is a servo drive and supports the profile's mode."""
    device = Requirement(
        0x1000, 0, 4, "device profile", DRIVE_PROFILE, mask=0xFFFF, write=False
    )  # fmt: skip
    if profile.mode == "makers":  # this mode has no bit in 6502h
        return (device,)
    bit = 1 << MODES[profile.mode] - 1
    return (
        device,
        Requirement(
            0x6502, 0, 4, f"supports {mode_words(profile.mode)}", bit,
            mask=bit, write=False, hexadecimal=True, lack="shown",
        ),
    )  # fmt: skip


def signal_object(profile: ServoProfile, signal: Signal) -> tuple[int, int]:
    """Return the object that contains a signal: that in the fixed PDOs, or that of CiA 402."""
    fixed = object_of(profile.pdos, signal)
    if fixed is not None:
        return fixed
    if signal == "target":
        return TARGETS[profile.mode]
    if signal == "torque":
        return object_address(profile.torque.object)
    return {"controlword": (0x6040, 0), "statusword": (0x6041, 0), "position": (0x6064, 0),
            "inputs": (0x60FD, 0)}[signal]  # fmt: skip


def cyclic_pdos(
    node_id: int, exchange: str, profile: ServoProfile | None = None
) -> tuple[PdoMapping, ...]:
    """Return the PDOs of a drive for an `exchange`, full or trimmed.

    At every SYNC the drive applies its synchronous RPDOs and sends its synchronous TPDOs. In the
    trimmed exchange the drive sends its statusword when it changes, and in any case every
    `STATUS_EVENT_MS`. For a drive with fixed PDOs, `exchange` has no effect.
    """
    profile = profile or ServoProfile()
    if profile.pdos:
        return tuple(_fixed_pdo(node_id, pdo) for pdo in profile.pdos)
    acts = EVERY_SYNC if profile.commands == "at_sync" else ON_EVENT
    word = MappedObject(*signal_object(profile, "controlword"), 16)
    status = MappedObject(*signal_object(profile, "statusword"), 16)
    target = MappedObject(*signal_object(profile, "target"), 32)
    position = MappedObject(*signal_object(profile, "position"), 32)
    torque = MappedObject(*signal_object(profile, "torque"), 16)
    if exchange == "full":
        answer = (status, position) if profile.torque.asked else (status, position, torque)
        inputs = MappedObject(*signal_object(profile, "inputs"), 32)
        more = (PdoMapping("tpdo", 2, tpdo_cob_id(node_id, 2), (inputs,)),)
        return (
            PdoMapping("rpdo", 1, rpdo_cob_id(node_id), (word, target), acts),
            PdoMapping("tpdo", 1, tpdo_cob_id(node_id), answer),
            *(more if profile.sends_inputs else ()),
        )
    return (
        PdoMapping("rpdo", 1, rpdo_cob_id(node_id), (target,), acts),
        PdoMapping("rpdo", 2, rpdo_cob_id(node_id, 2), (word,), acts),
        PdoMapping("tpdo", 1, tpdo_cob_id(node_id), (position, torque)),
        PdoMapping(
            "tpdo", 2, tpdo_cob_id(node_id, 2), (status,), ON_EVENT, event_timer_ms=STATUS_EVENT_MS
        ),
    )


def _fixed_pdo(node_id: int, pdo: FixedPdo) -> PdoMapping:
    objects = tuple(
        MappedObject(*object_address(entry.object), entry.bits) for entry in pdo.objects
    )
    direction: Literal["rpdo", "tpdo"] = "rpdo" if pdo.receives else "tpdo"
    cob_id = (rpdo_cob_id if pdo.receives else tpdo_cob_id)(node_id, pdo.number)
    return PdoMapping(direction, pdo.number, cob_id, objects, pdo.transmission, fixed=True)


def safety_requirements(
    cell: CellConfig,
    profile: ServoProfile,
    motor: MotorRatings,
    units: AxisUnits,
    acceleration: float,
) -> tuple[Requirement, ...]:
    """Return the required settings of a drive: monitoring, reactions to faults, limits, mode.

    A drive measures only its motor. In a robot with a coupled wrist, its following error and its
    deceleration are therefore those of the motor, divided by the gear ratio, and not those of a
    joint. `acceleration` is the joint's acceleration limit [rad/s² or m/s²].

    Raises:
        ConfigError: The torque limit cannot be converted to the units of its object.
    """
    safety, mode = cell.drive_safety, profile.mode
    return (
        Requirement(0x1005, 0, 4, "SYNC identifier", 0x80, mask=0x4000_07FF, write=False,
                    lack="shown"),
        Requirement(0x1006, 0, 4, "SYNC period [us]", lack="shown"),
        *_watches(cell, profile),
        Requirement(0x1029, 1, 1, "reaction to a communication error", 0, lack="shown"),
        Requirement(
            0x6007, 0, 2, "abort connection", safety.abort_connection,
            signed=True, watchdog=True, lack="trial",
        ),
        Requirement(0x605A, 0, 2, "quick-stop reaction", safety.quick_stop_option, signed=True,
                    lack="trial"),
        Requirement(0x605B, 0, 2, "shutdown reaction", signed=True, lack="shown"),
        Requirement(0x605C, 0, 2, "disable-operation reaction", signed=True, lack="shown"),
        Requirement(0x605D, 0, 2, "halt reaction", signed=True, lack="shown"),
        Requirement(0x605E, 0, 2, "fault reaction", safety.fault_reaction_option, signed=True,
                    lack="trial"),
        *_ramps(cell, profile, units, acceleration),
        Requirement(
            0x6065, 0, 4, "following-error window",
            abs(round(safety.following_error_rad * units.counts_per_rad)), lack="shown",
        ),
        Requirement(0x6066, 0, 2, "following-error time [ms]", safety.following_error_timeout_ms,
                    lack="shown"),
        *_torque_limit(cell, profile, motor),
        *(
            Requirement(*object_address(limit.object), 2, name, lack="shown")
            for name, limit in further_torque_limits(profile)
        ),
        Requirement(0x607D, 1, 4, "software position limit, low", signed=True, lack="shown"),
        Requirement(0x607D, 2, 4, "software position limit, high", signed=True, lack="shown"),
        Requirement(0x607E, 0, 1, "polarity", 0, mask=0xC0, write=False, lack="shown",
                    hexadecimal=True),
        Requirement(0x60B2, 0, 2, "torque offset", 0, signed=True, write=False, lack="shown"),
        Requirement(
            0x6060, 0, 1, f"mode: {mode_words(mode)}", MODES[mode],
            signed=True,
        ),
        *_cycle_time(cell, profile),
        Requirement(
            RPDO_COMMUNICATION, 5, 2, "command timeout [ms]",
            safety.master_heartbeat_timeout_ms, lack="shown",
        ),
        *(
            Requirement(
                *object_address(extra.object), extra.bits // 8, "set by the drive's profile",
                extra.value, signed=extra.value < 0, write=extra.written,
            )
            for extra in profile.settings
        ),
    )  # fmt: skip


def _watches(cell: CellConfig, profile: ServoProfile) -> Iterator[Requirement]:
    """Yield the settings by which drive and computer monitor each other.

    A node that sends a heartbeat cannot use life guarding (CiA 301, 7.2.8.3). With life guarding,
    1017h must therefore be 0.
    """
    safety = cell.drive_safety
    timeout_ms, period_ms = safety.master_heartbeat_timeout_ms, safety.master_heartbeat_ms
    if profile.watch == "life_guarding":
        yield Requirement(0x1017, 0, 2, "heartbeat period [ms]", 0, lack="shown")
        yield Requirement(*GUARD_TIME, 2, "guard time [ms]", period_ms, watchdog=True)
        factor = timeout_ms // period_ms
        yield Requirement(*LIFE_TIME_FACTOR, 1, "life time [guard times]", factor, watchdog=True)
        return
    yield Requirement(0x1017, 0, 2, "heartbeat period [ms]", safety.drive_heartbeat_ms)
    master = consumer_entry(safety.master_node_id, timeout_ms)
    yield Requirement(
        0x1016, 1, 4, "monitoring of this computer's heartbeat", master,
        watchdog=True, hexadecimal=True,
    )  # fmt: skip


def _ramps(
    cell: CellConfig, profile: ServoProfile, units: AxisUnits, acceleration: float
) -> Iterator[Requirement]:
    """Yield the decelerations of a stop, and ramps to set-points that are steep enough."""
    factor = abs(units.acceleration_units_per_rad_s2)
    deceleration = cell.drive_safety.quick_stop_deceleration_rad_s2
    if profile.deceleration_rad_s2 is None:
        value = round(deceleration * factor)
        yield Requirement(*QUICK_STOP_DECELERATION, 4, "quick-stop deceleration", value)
    if profile.by_ramp:
        steep = round(max(deceleration, _STEEPER * acceleration) * factor)
        yield Requirement(0x6083, 0, 4, "profile acceleration", steep)
        steep_or_none = None if object_name(*PROFILE_DECELERATION) in profile.read_only else steep
        yield Requirement(
            *PROFILE_DECELERATION, 4, "profile deceleration", steep_or_none, lack="shown"
        )
    elif uses_profile_deceleration(cell):
        value = round(deceleration * factor)
        yield Requirement(*PROFILE_DECELERATION, 4, "profile deceleration", value)


def _torque_limit(
    cell: CellConfig, profile: ServoProfile, motor: MotorRatings
) -> Iterator[Requirement]:
    limit = profile.torque_limit
    if limit is None:
        return
    value = None
    if profile.torque_limit_written:
        value = motor.limit(limit, cell.drive_safety.torque_limit_fraction)
    unit = f"1/{limit.units:g} {limit.of.replace('_', ' ')}"
    name = f"torque limit [{'0.1 %' if limit.of != 'ampere' and limit.units == _MILLI else unit}]"
    yield Requirement(*object_address(limit.object), limit.bits // 8, name, value)


def _cycle_time(cell: CellConfig, profile: ServoProfile) -> Iterator[Requirement]:
    if profile.by_ramp:
        return
    period = interpolation_period(cell.cycle_time_ms)
    if period is None:  # refused by `CellConfig.check_cycle_time` if needed
        return
    mantissa, power = period
    unit = "ms" if power == -3 else f"1e{power} s"
    parts = ((f"cycle time [{unit}]", mantissa), ("cycle time, power of ten", power))
    written = profile.cycle_time_written
    lack: Literal["red", "shown"] = "red" if written else "shown"
    for subindex, (name, value) in enumerate(parts, 1):
        yield Requirement(
            0x60C2, subindex, 1, name, value, signed=subindex == 2, lack=lack, write=written
        )
