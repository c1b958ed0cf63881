"""The CiA 402-2 drive: power state machine, option codes and units."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

from config.cell.cell import DriveAxis
from config.cell.servo_profile import Mode, ServoProfile, TorqueObject
from config.errors import ConfigError
from config.robot.robot import Joint
from drivers.canopen.sdo import object_name
from drivers.interfaces.servo_axes import DriveSetting
from drivers.servo.position_counter import BITS_32, PositionCounter

MAKERS_OWN = -1
PROFILE_VELOCITY = 3
INTERPOLATED_POSITION = 7
CYCLIC_SYNCHRONOUS_POSITION = 8
CYCLIC_SYNCHRONOUS_VELOCITY = 9
DRIVE_PROFILE = 402
FOLLOWS_COMMAND = 0x1000
VOLTAGE_ENABLED = 0x0010
PLAUSIBLE_RATED_TORQUE = (0.01, 30.0)
"""A motor's rated torque at the joint, as a share of the joint's torque limit.

A sound ratio is 0.1 to 3; a rating in mN m taken for N m is 1000 times as much.
"""


class PowerState(IntEnum):
    """States of the power drive system (CiA 402-2, figure 9); the value is 6041h masked."""

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
        """The state's name for people."""
        return self.name.lower().replace("_", " ")

    @property
    def powered(self) -> bool:
        """Whether the drive may move its motor in this state."""
        return self in _POWERED

    @property
    def faulty(self) -> bool:
        """Whether the drive has a fault, or is on its way there."""
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
    """Commands of 6040h (CiA 402-2, table 30)."""

    DISABLE_VOLTAGE = 0x0000
    QUICK_STOP = 0x0002
    SHUTDOWN = 0x0006
    SWITCH_ON = 0x0007
    ENABLE_OPERATION = 0x000F
    ENABLE_INTERPOLATION = 0x001F
    FAULT_RESET = 0x0080


def state_of(statusword: int) -> PowerState:
    """Return the state that 6041h shows (CiA 402-2, table 31).

    A pattern that the table does not have is read as not ready to switch on: nothing is commanded
    on the strength of it.
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

    A drive in Fault is left there: nothing resets a fault but a person (`FAULT_RESET`).
    """
    return _TOWARDS_ENABLED.get(state, ControlWord.DISABLE_VOLTAGE)


_TOWARDS_ENABLED = {
    PowerState.SWITCH_ON_DISABLED: ControlWord.SHUTDOWN,
    PowerState.READY_TO_SWITCH_ON: ControlWord.SWITCH_ON,
    PowerState.SWITCHED_ON: ControlWord.ENABLE_OPERATION,
    PowerState.OPERATION_ENABLED: ControlWord.ENABLE_OPERATION,
}


def enabling_word(mode: Mode) -> ControlWord:
    """Return the controlword that lets a drive follow its set-points in a mode."""
    if mode == "interpolated_position":
        return ControlWord.ENABLE_INTERPOLATION
    return ControlWord.ENABLE_OPERATION


def after_controlword(state: PowerState, controlword: int, previous: int) -> PowerState:
    """Return the state that a controlword takes a drive to (CiA 402-2, figure 9 and table 30).

    Args:
        state: The state now. `NOT_READY_TO_SWITCH_ON` and `FAULT_REACTION_ACTIVE` are left by the
            drive itself (T1, T14) and stay here; so does the end of a quick stop (T12).
        controlword, previous: 6040h now and before: fault reset acts on a rising edge of bit 7.
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
    """Apply a command whose enable-voltage and quick-stop bits are both set."""
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
    """What a drive, or the cell file, tells of a motor; None is what is not needed.

    Attributes:
        increments: Units of 6064h in a motor revolution.
        torque_nm, current_a: Rated torque [N m] and rated current [A].
        nm_per_a: Torque constant [N m/A].
    """

    increments: float
    torque_nm: float | None = None
    current_a: float | None = None
    nm_per_a: float | None = None

    @property
    def rated_nm(self) -> float | None:
        """The rated torque [N m], by the rated current if need be; None if it is not known."""
        if self.torque_nm is None and self.current_a is not None and self.nm_per_a is not None:
            return self.current_a * self.nm_per_a
        return self.torque_nm

    def nm_per_unit(self, of: TorqueObject) -> float:
        """Return the motor's torque per unit of a torque object [N m].

        Raises:
            ConfigError: What the object is related to is not known.
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
                f"{of.object} cannot be told in N m: name {lacking} in the axis's servo",
                code="RID-SERVO-VALUE",
            )
        return whole / of.units

    def limit(self, of: TorqueObject, fraction: float) -> int:
        """Return what a torque limit's object must hold for a fraction of the rated torque.

        Raises:
            ConfigError: The rated current is needed and not known.
        """
        if of.of == "ampere":
            if self.current_a is None:
                raise ConfigError(
                    f"{of.object}: name rated_current_a in the axis's servo", code="RID-SERVO-VALUE"
                )
            return round(fraction * self.current_a * of.units)
        return round(fraction * of.units)


@dataclass(frozen=True)
class AxisUnits:
    """Between a drive's numbers and the joint's: rad (or m), rad/s and N m at the link side.

    Attributes:
        counts_per_rad: Encoder increments per radian (or metre) of the joint; negative where they
            count backwards.
        velocity_units_per_rad_s: Units of 60FFh per rad/s of the joint, same sign.
        acceleration_units_per_rad_s2: Units of 6085h per rad/s² of the joint, same sign.
        nm_per_torque_unit: Joint torque per unit of the object that tells it, same sign: 0.1 % of
            the rated motor torque with 6077h.
        zero_counts: 6064h at joint position zero.
        counter: How 6064h wraps.
        middle_counts: From joint position zero to the middle of the joint's range: positions are
            within half a round of the counter of it.
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
                f"a drive's unit factors are {factors}: all must be finite, not 0",
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
        """Build the factors from what is known of a motor, and the units of its drive's family.

        `gear_ratio` is motor radians per joint radian; its sign is `direction`. Velocities in rpm
        are the motor's. Source: CiA 402-2, 608Fh, 6091h, 6076h.

        Raises:
            ConfigError: The torque cannot be told in N m, or a factor is 0 or not finite.
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
        """Return the joint position of 6064h [rad or m]."""
        turned = self.counter.nearest(counts, self.zero_counts + self.middle_counts)
        return (turned - self.zero_counts) / self.counts_per_rad

    def counts(self, position: float) -> int:
        """Return 6064h of a joint position, rounded to the nearest increment."""
        return self.counter.shown(round(position * self.counts_per_rad) + self.zero_counts)

    def velocity(self, units: int) -> float:
        """Return the joint velocity of 60FFh or 606Ch [rad/s]."""
        return units / self.velocity_units_per_rad_s

    def torque_nm(self, units: int) -> float:
        """Return the joint torque of the drive's number [N m], without the gear's losses."""
        return units * self.nm_per_torque_unit


def torque_setting(
    axis: DriveAxis, joint: Joint, rated_nm: float, at_joint_nm: float
) -> DriveSetting:
    """Return the line that compares a motor's rated torque with the joint's limit.

    Args:
        axis, joint: The drive, and the joint that it moves.
        rated_nm, at_joint_nm: The motor's rated torque, and the same behind the gear [N m].
    """
    limit = joint.limits.torque
    least, most = (share * limit for share in PLAUSIBLE_RATED_TORQUE)
    good = least <= at_joint_nm <= most
    return DriveSetting(
        axis.joint,
        axis.node_id,
        object_name(0x6076, 0),
        "rated torque at the joint",
        f"{least:.3g} to {most:.3g} N m",
        f"{at_joint_nm:.4g} N m",
        "ok" if good else "red",
        f"the motor's rated torque is taken as {rated_nm:.4g} N m: correct rated_torque_nm"
        " (N m, not mN m), rated_torque_units or torque_constant_nm_per_a in the axis's servo, or"
        f" the joint's torque limit, {limit:g} N m, in the robot file",
    )
