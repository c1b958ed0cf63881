"""CiA 402-2 drives: power state machine, modes and units."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

from config.cell.servo_profile import Mode, ServoProfile, TorqueObject
from config.errors import ConfigError
from drivers.servo.position_counter import BITS_32, PositionCounter

MAKERS_OWN = -1
PROFILE_VELOCITY = 3
INTERPOLATED_POSITION = 7
CYCLIC_SYNCHRONOUS_POSITION = 8
CYCLIC_SYNCHRONOUS_VELOCITY = 9
DRIVE_PROFILE = 402
FOLLOWS_COMMAND = 0x1000
VOLTAGE_ENABLED = 0x0010


class PowerState(IntEnum):
    """States of the power drive system (CiA 402-2, figure 9); values: the state bits of 6041h."""

    NOT_READY_TO_SWITCH_ON = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY_TO_SWITCH_ON = 0x21
    SWITCHED_ON = 0x23
    OPERATION_ENABLED = 0x27
    QUICK_STOP_ACTIVE = 0x07
    FAULT_REACTION_ACTIVE = 0x0F
    FAULT = 0x08

    @property
    def words(self) -> str:
        """The state's name in words."""
        return self.name.lower().replace("_", " ")

    @property
    def powered(self) -> bool:
        """True if the drive can move its motor in this state."""
        return self in _POWERED

    @property
    def faulty(self) -> bool:
        """True if the drive is in Fault, or reacts to a fault before it enters Fault."""
        return self in _FAULTY


_POWERED = frozenset(
    (
        PowerState.OPERATION_ENABLED,
        PowerState.QUICK_STOP_ACTIVE,
        PowerState.FAULT_REACTION_ACTIVE,
    )
)
_FAULTY = frozenset((PowerState.FAULT, PowerState.FAULT_REACTION_ACTIVE))


class ControlWord(IntEnum):
    """Commands to the power state machine by 6040h (CiA 402-2, table 30)."""

    DISABLE_VOLTAGE = 0x0000
    QUICK_STOP = 0x0002
    SHUTDOWN = 0x0006
    SWITCH_ON = 0x0007
    ENABLE_OPERATION = 0x000F
    ENABLE_INTERPOLATION = 0x001F
    FAULT_RESET = 0x0080


def state_of(statusword: int) -> PowerState:
    """Return the power state that a value of 6041h contains (CiA 402-2, table 31).

    A bit pattern that is not in the table counts as not ready to switch on, because no command to
    enable the drive follows from this state.
    """
    return _STATE_OF[statusword & 0x6F]


def _decode(bits: int) -> PowerState:
    for state in (
        PowerState.NOT_READY_TO_SWITCH_ON,
        PowerState.SWITCH_ON_DISABLED,
        PowerState.FAULT_REACTION_ACTIVE,
        PowerState.FAULT,
    ):
        if bits & 0x4F == state:
            return state
    for state in (
        PowerState.READY_TO_SWITCH_ON,
        PowerState.SWITCHED_ON,
        PowerState.OPERATION_ENABLED,
        PowerState.QUICK_STOP_ACTIVE,
    ):
        if bits == state:
            return state
    return PowerState.NOT_READY_TO_SWITCH_ON


_STATE_OF = tuple(_decode(bits) for bits in range(0x70))


def next_controlword(state: PowerState) -> ControlWord:
    """Return the command that brings a drive one step nearer to Operation Enabled.

    A drive in Fault stays there: `drivers.servo.fault_reset` resets faults.
    """
    return _TOWARDS_ENABLED.get(state, ControlWord.DISABLE_VOLTAGE)


_TOWARDS_ENABLED = {
    PowerState.SWITCH_ON_DISABLED: ControlWord.SHUTDOWN,
    PowerState.READY_TO_SWITCH_ON: ControlWord.SWITCH_ON,
    PowerState.SWITCHED_ON: ControlWord.ENABLE_OPERATION,
    PowerState.OPERATION_ENABLED: ControlWord.ENABLE_OPERATION,
}


def enabling_word(mode: Mode) -> ControlWord:
    """Return the controlword with which a drive in a mode follows its set-points."""
    if mode == "interpolated_position":
        return ControlWord.ENABLE_INTERPOLATION
    return ControlWord.ENABLE_OPERATION


def after_controlword(state: PowerState, controlword: int, previous: int) -> PowerState:
    """Return the state after a controlword (CiA 402-2, figure 9 and table 30).

    Args:
        state: The present state. The drive itself leaves `NOT_READY_TO_SWITCH_ON` and
            `FAULT_REACTION_ACTIVE` (T1, T14), and ends a quick stop (T12); these transitions are
            not modelled.
        controlword, previous: The new value of 6040h, and the one before it: a fault is reset by a
            rising edge of bit 7.
    """
    if state in (PowerState.NOT_READY_TO_SWITCH_ON, PowerState.FAULT_REACTION_ACTIVE):
        return state
    if state is PowerState.FAULT:
        rising = controlword & 0x80 and not previous & 0x80
        return PowerState.SWITCH_ON_DISABLED if rising else state
    if controlword & 0x80:
        return state
    if not controlword & 0x02:
        return PowerState.SWITCH_ON_DISABLED
    if not controlword & 0x04:
        running = (PowerState.OPERATION_ENABLED, PowerState.QUICK_STOP_ACTIVE)
        return PowerState.QUICK_STOP_ACTIVE if state in running else PowerState.SWITCH_ON_DISABLED
    return _after_low_bits(state, controlword & 0x0F)


def _after_low_bits(state: PowerState, low: int) -> PowerState:
    """Return the state after a controlword whose enable-voltage and quick-stop bits are set."""
    if not low & 0x01:
        ready = PowerState.READY_TO_SWITCH_ON
        return state if state is PowerState.QUICK_STOP_ACTIVE else ready
    if low == ControlWord.ENABLE_OPERATION:
        enabled = (
            PowerState.SWITCHED_ON,
            PowerState.OPERATION_ENABLED,
            PowerState.QUICK_STOP_ACTIVE,
        )
        if state in enabled:
            return PowerState.OPERATION_ENABLED
        on = state is PowerState.READY_TO_SWITCH_ON
        return PowerState.SWITCHED_ON if on else state
    switched = (PowerState.READY_TO_SWITCH_ON, PowerState.OPERATION_ENABLED)
    return PowerState.SWITCHED_ON if state in switched else state


@dataclass(frozen=True, slots=True)
class MotorRatings:
    """Ratings of a motor, from its drive or the cell file; None for a rating that is not needed.

    Attributes:
        increments: Units of 6064h per motor revolution.
        torque_nm, current_a: Rated torque [N m] and rated current [A].
        nm_per_a: Torque constant [N m/A].
    """

    increments: float
    torque_nm: float | None = None
    current_a: float | None = None
    nm_per_a: float | None = None

    @property
    def rated_nm(self) -> float | None:
        """Rated torque [N m], if necessary computed from the rated current; None if unknown."""
        if self.torque_nm is None and self.current_a is not None and self.nm_per_a is not None:
            return self.current_a * self.nm_per_a
        return self.torque_nm

    def rated_nm_by(self, of: TorqueObject) -> float | None:
        """Return the rated torque by the ratings that convert a torque object; None if unknown.

        If the object holds a current, this is the product of rated current and torque constant.
        """
        if of.of == "rated_torque" or self.current_a is None or self.nm_per_a is None:
            return self.rated_nm
        return self.current_a * self.nm_per_a

    def nm_per_unit(self, of: TorqueObject) -> float:
        """Return the motor torque that one unit of a torque object represents [N m].

        Raises:
            ConfigError: The rating to which the object's unit refers is unknown.
        """
        whole, lacking = self.torque_nm, "rated_torque_nm"
        if of.of != "rated_torque":
            amperes = 1.0 if of.of == "ampere" else self.current_a
            lacking = "rated_current_a" if amperes is None else "torque_constant_nm_per_a"
            whole = None
            if amperes is not None and self.nm_per_a is not None:
                whole = amperes * self.nm_per_a
        if whole is None:
            raise ConfigError(
                f"cannot convert {of.object} to N m; set {lacking} in the axis's servo",
                code="RID-SERVO-VALUE",
            )
        return whole / of.units

    def limit(self, of: TorqueObject, fraction: float) -> int:
        """Return a torque limit, a fraction of the rated torque, in the unit of its object.

        Raises:
            ConfigError: The rated current is needed but unknown.
        """
        if of.of == "ampere":
            if self.current_a is None:
                raise ConfigError(
                    f"cannot convert {of.object} to amperes; set rated_current_a in the axis's"
                    " servo",
                    code="RID-SERVO-VALUE",
                )
            return round(fraction * self.current_a * of.units)
        return round(fraction * of.units)


@dataclass(frozen=True)
class AxisUnits:
    """Conversion of a drive's numbers to rad (or m), rad/s and N m of the joint, at the link side.

    Attributes:
        counts_per_rad: Encoder increments per radian (or metre) of the joint; negative if the
            counts decrease when the joint position increases.
        velocity_units_per_rad_s: Units of 60FFh per rad/s of the joint, with the sign of
            `counts_per_rad`.
        acceleration_units_per_rad_s2: Units of 6085h per rad/s² of the joint, with the sign of
            `counts_per_rad`.
        nm_per_torque_unit: Joint torque per unit of the torque object [N m], with the sign of
            `counts_per_rad`. A unit of 6077h is 0.1 % of the rated motor torque.
        zero_counts: Value of 6064h at joint position zero.
        counter: Range of 6064h, which wraps around at its ends.
        middle_counts: Counts from joint position zero to the middle of the joint's range. Every
            position is within half the counter's range of this middle, which makes it unique.
    """

    counts_per_rad: float
    velocity_units_per_rad_s: float
    acceleration_units_per_rad_s2: float
    nm_per_torque_unit: float
    zero_counts: int = 0
    counter: PositionCounter = BITS_32
    middle_counts: int = 0

    def __post_init__(self) -> None:
        factors = (
            self.counts_per_rad,
            self.velocity_units_per_rad_s,
            self.acceleration_units_per_rad_s2,
            self.nm_per_torque_unit,
        )
        if not all(math.isfinite(factor) and factor != 0.0 for factor in factors):
            raise ConfigError(
                f"a drive's unit factors are {factors}; all must be finite and not 0; correct the"
                " axis's servo",
                code="RID-SERVO-VALUE",
            )

    @classmethod
    def of_motor(
        cls,
        motor: MotorRatings,
        profile: ServoProfile,
        gear_ratio: float,
        direction: Literal[1, -1] = 1,
        zero_counts: int = 0,
    ) -> AxisUnits:
        """Compute the factors from a motor's ratings and the units in its drive's profile.

        `gear_ratio` is motor radians per joint radian; its sign is `direction`. A velocity unit in
        rpm refers to the motor. Source: CiA 402-2, 608Fh, 6091h, 6076h.

        Raises:
            ConfigError: The torque cannot be converted to N m, or a factor is 0 or not finite.
        """
        ratio = direction * abs(gear_ratio)
        per_rad = motor.increments / (2.0 * math.pi)

        def factor(units: tuple[float, float]) -> float:
            per_increment, per_rpm = units
            return ratio * (per_increment * per_rad + per_rpm * 30.0 / math.pi)

        return cls(
            counts_per_rad=per_rad * ratio,
            velocity_units_per_rad_s=factor(profile.velocity_per_increment),
            acceleration_units_per_rad_s2=factor(profile.acceleration_per_increment),
            nm_per_torque_unit=ratio * motor.nm_per_unit(profile.torque),
            zero_counts=zero_counts,
        )

    def position(self, counts: int) -> float:
        """Return the joint position for a value of 6064h [rad or m]."""
        turned = self.counter.nearest(counts, self.zero_counts + self.middle_counts)
        return (turned - self.zero_counts) / self.counts_per_rad

    def counts(self, position: float) -> int:
        """Return the value of 6064h for a joint position, rounded to the nearest increment."""
        return self.counter.to_range(round(position * self.counts_per_rad) + self.zero_counts)

    def velocity(self, units: int) -> float:
        """Return the joint velocity for a value of 60FFh or 606Ch [rad/s]."""
        return units / self.velocity_units_per_rad_s

    def torque_nm(self, units: int) -> float:
        """Return the joint torque for a value of the torque object [N m], without gear losses."""
        return units * self.nm_per_torque_unit
