"""`ServoProfile`: the objects that a family of servo drives uses, and the units of their numbers.

A profile describes how drives that follow CiA 402 differ, so that a drive of another maker usually
needs only another file. `drivers/servo/requirements.py` defines the values that a drive must have
before motion.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from config.cell.extra_setting import ExtraSetting, check_settings
from config.cell.fixed_pdo import (
    ANSWERS,
    COMMANDS,
    FixedPdo,
    ObjectName,
    Signal,
    object_address,
    object_of,
)
from config.model import ConfigModel
from config.plausible import Plausible
from config.quantities import Positive

Unsigned32 = Annotated[int, Field(ge=0, lt=2**32)]
FamilyObject = Annotated[str, Field(pattern=r"^[0-9A-F]{4}h(:[0-9A-F]{2})?$")]
Mode = Literal[
    "cyclic_velocity", "profile_velocity", "cyclic_position", "interpolated_position", "makers"
]
VelocityUnit = Literal["increments_per_s", "rpm", "0.1rpm"]
Watch = Literal["heartbeat", "life_guarding"]
RatingObject = Literal["6073h", "6075h", "6076h", "608Fh", "60E0h", "60E1h", "6410h"]
ErrorCode = Annotated[int, Field(gt=0, le=0xFFFF)]
Units = Annotated[Positive, Plausible(1e-9, 1e9, "")]

BY_POSITION: Final[tuple[Mode, ...]] = ("cyclic_position", "interpolated_position")

_STATUSWORD: Final = "6041h:00"
_MAKERS_STATUS_BITS: Final = 1 << 8 | 1 << 14 | 1 << 15
_INCREMENTS: Final = ("increments_per_s", 1.0)
FEWEST_INCREMENTS: Final = 500.0
"""Smallest plausible number of increments per motor revolution: an encoder of 125 lines."""
RATINGS_AGREE: Final = 1.6
"""Largest accepted factor between the torque constant and its estimate, the rated torque divided by
the rated current.
"""
_TENTHS: Final = {"0.1rpm": 10.0}


TARGETS: Final[dict[Mode, tuple[int, int]]] = {
    "cyclic_velocity": (0x60FF, 0),
    "profile_velocity": (0x60FF, 0),
    "cyclic_position": (0x607A, 0),
    "interpolated_position": (0x60C1, 1),
}
"""Object of the set-point in each mode; in a manufacturer-specific mode, the fixed PDOs define
it."""
BY_RAMP: Final[tuple[Mode, ...]] = ("profile_velocity", "makers")
"""Modes in which the drive ramps to each velocity, by its 6083h and 6084h."""


class TorqueObject(ConfigModel):
    """An object that holds a torque or a current.

    Attributes:
        object: Index and subindex, such as `6077h:00`.
        of: Unit of the value: the rated torque, the rated current, or one ampere. The object holds
            `units` counts per unit.
        units: Counts per unit.
        bits: Size of the object.
        asked: True if no PDO can carry the object, so that it is read by SDO after every SYNC.
    """

    object: ObjectName
    of: Literal["rated_torque", "rated_current", "ampere"] = "rated_torque"
    units: Units = 1000.0
    bits: Literal[16, 32] = 16
    asked: bool = False


class ReferencedBits(ConfigModel):
    """Bits of an object that report whether a drive was homed since its encoder lost position.

    Of 6041h only bits 8, 14 and 15 can be used: CiA 402 leaves no other bit to the manufacturer,
    and bit 12 means "homing attained" only in homing mode.

    Attributes:
        object: Index and subindex.
        bits: Size of the object.
        mask: The bits that are evaluated.
        value: The drive is referenced if the masked object equals this value; without a value, if
            all bits of the mask are set.
    """

    object: ObjectName
    bits: Literal[8, 16, 32] = 16
    mask: Annotated[int, Field(gt=0, lt=2**32)]
    value: Unsigned32 | None = None

    @model_validator(mode="after")
    def _check_mask(self) -> Self:
        if self.mask >> self.bits:
            raise ValueError(
                f"mask {self.mask} does not fit the object's {self.bits} bits; correct mask or bits"
            )
        if self.referenced_value & ~self.mask:
            raise ValueError(
                f"value {self.referenced_value} has bits outside mask {self.mask}; correct value or"
                " mask"
            )
        if self.object == _STATUSWORD and self.mask & ~_MAKERS_STATUS_BITS:
            raise ValueError(
                f"mask {self.mask} of 6041h uses bits that CiA 402 defines; use bit 8 (256),"
                " 14 (16384) or 15 (32768), by the drive's manual, or another object"
            )
        return self

    @property
    def referenced_value(self) -> int:
        """Value of the masked bits if the drive is referenced."""
        return self.mask if self.value is None else self.value


class ServoProfile(ConfigModel):
    """One family of drives, or the keys that a cell file adds for one drive.

    Attributes:
        base: Profile (bundled name, or path relative to the cell file) for the keys that are left
            out. Without it, an axis takes them from the cell's `servo`; otherwise they are those of
            CiA 402.
        vendor: Vendor id (1018h:01), by which the profile for an electronic data sheet is found.
        mode: Mode of operation, with its value of 6060h: `cyclic_velocity` (9), `profile_velocity`
            (3), `cyclic_position` (8), `interpolated_position` (7), or `makers` (-1), the
            manufacturer's own mode. With `makers`, `pdos` name the object that receives the
            velocity. In a position mode the drive receives positions in increments: the sum of the
            commanded velocities.
        encoder_increments: Units of 6064h per motor revolution; replaces 608Fh.
        velocity_unit: Unit of velocity.
        velocity_units: Counts of 60FFh per unit of velocity.
        acceleration_unit: Unit of velocity in the drive's accelerations; by default
            `velocity_unit`.
        acceleration_units: Counts of 6083h to 6085h per unit of velocity and second. Left out, it
            is `velocity_units`, or 1 if `acceleration_unit` is given.
        rated_torque_nm: Rated torque of the motor; replaces 6076h.
        rated_torque_units: Counts of 6076h per N m.
        rated_current_a: Rated current of the motor; replaces 6075h.
        rated_current_object: Object that holds the rated current [mA].
        torque_constant_nm_per_a: Torque constant of the motor, needed if the drive reports a
            current instead of a torque.
        torque: The measured torque or current, part of every cycle's answer.
        torque_limit: Object that limits the torque; null if the drive has none.
        torque_limit_written: True if the torque limit of the cell's `drive_safety` is written to
            the object `torque_limit`; false if the object is only read and shown.
        deceleration_rad_s2: Deceleration of the joint at a stop, if the drive has no object 6085h.
        commands: Commands take effect at the next SYNC or, if the drive's RPDOs ignore SYNC, on
            arrival.
        pdos: PDOs of a drive that does not allow another mapping; they are used unchanged.
        cycle_time_written: False if the drive takes the period of its set-points from SYNC, or from
            its own tool: 60C2h is then compared, if it exists, and not written.
        enable_timeout_s: Longest time from Switch On Disabled to Operation Enabled, including
            brakes and precharge.
        follows_bit: False if the drive never sets bit 12 of 6041h (drive follows the command
            value).
        not_compared: Objects of the drive's ratings and torque limits whose values are known to be
            wrong. Any other rating in the cell file is refused if the drive states another value.
        referenced: Bits that report that the drive has been homed. A drive whose bits report the
            opposite is refused. Without this key, the program does not know if the drive was homed.
        watch: How drive and computer detect each other's failure: by heartbeats (1016h, 1017h) or,
            for a drive without 1016h, by life guarding (100Ch, 100Dh), in which its state is
            requested.
        lost_connection_codes: Error codes (603Fh, emergency message) by which the drive reports
            that this computer is silent. The watchdog test accepts and resets only faults with
            these codes.
        digital_inputs: True if the drive sends its digital inputs (60FDh) in every cycle, in TPDO
            2. A drive with fixed PDOs sends them if `pdos` carry the signal `inputs`.
        settings: Further objects that must hold a value; a simulated drive has them too.
        lacks: Objects that a simulated drive of the family does not have.
        read_only: Objects that cannot be written.
    """

    base: str | None = Field(default=None, min_length=1)
    vendor: Unsigned32 | None = None
    mode: Mode = "cyclic_velocity"
    encoder_increments: Annotated[Positive, Plausible(FEWEST_INCREMENTS, 4.3e9, "")] | None = None
    velocity_unit: VelocityUnit = "increments_per_s"
    velocity_units: Units = 1.0
    acceleration_unit: VelocityUnit | None = None
    acceleration_units: Units | None = None
    rated_torque_nm: Annotated[Positive, Plausible(1e-3, 5e3, "N m")] | None = None
    rated_torque_units: Units = 1000.0
    rated_current_a: Annotated[Positive, Plausible(1e-2, 2e3, "A")] | None = None
    rated_current_object: ObjectName = "6075h:00"
    torque_constant_nm_per_a: Annotated[Positive, Plausible(1e-3, 50.0, "N m/A")] | None = None
    torque: TorqueObject = TorqueObject(object="6077h:00")
    torque_limit: TorqueObject | None = TorqueObject(object="6072h:00")
    torque_limit_written: bool = True
    deceleration_rad_s2: Annotated[Positive, Plausible(0.1, 2e3, "rad/s² or m/s²")] | None = None
    commands: Literal["at_sync", "on_arrival"] = "at_sync"
    pdos: tuple[FixedPdo, ...] = ()
    cycle_time_written: bool = True
    enable_timeout_s: Annotated[Positive, Plausible(0.1, 60.0, "s")] = 4.0
    follows_bit: bool = True
    not_compared: tuple[RatingObject, ...] = ()
    referenced: ReferencedBits | None = None
    watch: Watch = "heartbeat"
    lost_connection_codes: Annotated[tuple[ErrorCode, ...], Field(min_length=1)] = (0x8130,)
    digital_inputs: bool = False
    settings: tuple[ExtraSetting, ...] = ()
    lacks: tuple[FamilyObject, ...] = ()
    read_only: tuple[ObjectName, ...] = ()

    @model_validator(mode="after")
    def _check_keys(self) -> Self:
        check_settings(self.settings)
        if self.by_position and (self.velocity_unit, self.velocity_units) != _INCREMENTS:
            raise ValueError("velocity_unit does not apply to position-mode drives; remove it")
        if self.mode == "makers" and not (self.pdos or self.base):
            raise ValueError("mode makers needs pdos; name the PDO that receives the velocity")
        if self.pdos and self.digital_inputs:
            raise ValueError(
                "digital_inputs does not apply to a drive with fixed pdos; remove it, and name"
                " the signal inputs in pdos"
            )
        if self.pdos:
            _check_pdos(self.pdos, self.torque, complete=self.base is None)
        if self.base is None:
            self.check_complete()
        return self

    def check_complete(self) -> None:
        """Refuse keys that contradict each other; the keys of a base profile must be included.

        Raises:
            ValueError: The torque fits no answer; the fixed PDOs lack a signal, repeat one, or
                carry another torque object or the set-point of another mode; the torque limit is
                also in `settings`; or the motor's ratings contradict each other.
        """
        if self.torque.bits != 16 and not (self.torque.asked or self.pdos):
            raise ValueError(
                f"torque.bits is {self.torque.bits}; an answer of 8 bytes needs 16 bits"
            )
        _check_ratings(self.rated_torque_nm, self.rated_current_a, self.torque_constant_nm_per_a)
        if self.pdos:
            _check_pdos(self.pdos, self.torque, complete=True)
        target = object_of(self.pdos, "target")
        if target is not None and self.mode != "makers" and target != TARGETS[self.mode]:
            index, subindex = target
            raise ValueError(
                f"mode {self.mode} does not use {index:04X}h:{subindex:02X}, which the fixed pdos"
                " carry as signal target; correct mode, or name the drive's pdos for this mode"
            )
        limit = self.torque_limit
        if limit is not None and self.torque_limit_written:
            for extra in self.settings:
                if extra.object == limit.object and extra.written:
                    raise ValueError(
                        f"{extra.object} is set by torque_limit; remove it from settings, or add"
                        " torque_limit_written: false"
                    )

    def on(self, base: ServoProfile) -> ServoProfile:
        """Return this profile; the keys that it does not set are those of `base`."""
        own_keys = {name: getattr(self, name) for name in self.model_fields_set}
        return base.model_copy(update=own_keys | {"base": None})

    @property
    def spread(self) -> bool:
        """True if the drive's data of one cycle can be in more than one frame."""
        return bool(self.pdos) or self.torque.asked or self.sends_inputs

    @property
    def sends_inputs(self) -> bool:
        """True if the drive sends its digital inputs in every cycle."""
        if self.pdos:
            return object_of(self.pdos, "inputs") is not None
        return self.digital_inputs

    @property
    def by_ramp(self) -> bool:
        """True if the drive ramps to each velocity."""
        return self.mode in BY_RAMP

    @property
    def by_position(self) -> bool:
        """True if the drive receives positions."""
        return self.mode in BY_POSITION

    @property
    def sets_increments(self) -> bool:
        """True if the profile sets 608Fh as a factor; it then does not describe the encoder."""
        return any(extra.object.startswith("608Fh") for extra in self.settings)

    @property
    def velocity_per_increment(self) -> tuple[float, float]:
        """Units of 60FFh per increment/s and per rpm; one of the two is 0."""
        return _per_increment(self.velocity_unit, self.velocity_units)

    @property
    def acceleration_per_increment(self) -> tuple[float, float]:
        """Units of 6085h per increment/s² and per rpm/s; one of the two is 0."""
        unit = self.acceleration_unit or self.velocity_unit
        units = self.velocity_units if self.acceleration_unit is None else 1.0
        return _per_increment(unit, self.acceleration_units or units)


def _per_increment(unit: VelocityUnit, units: float) -> tuple[float, float]:
    if unit == "increments_per_s":
        return units, 0.0
    return 0.0, units * _TENTHS.get(unit, 1.0)


def _check_ratings(torque: float | None, current: float | None, constant: float | None) -> None:
    """Refuse ratings of a motor that contradict each other.

    The torque constant is the rated torque divided by the rated current, except for the motor's
    losses.
    """
    if torque is None or current is None or constant is None:
        return
    if not 1.0 / RATINGS_AGREE <= constant * current / torque <= RATINGS_AGREE:
        raise ValueError(
            f"the motor's ratings contradict each other: {torque:g} N m / {current:g} A ="
            f" {torque / current:.3g} N m/A, not {constant:g} N m/A; correct the wrong one by the"
            " motor's data sheet (effective and peak values differ by 1.41)"
        )


def _check_pdos(pdos: tuple[FixedPdo, ...], torque: TorqueObject, *, complete: bool) -> None:
    carried = [signal for pdo in pdos for signal in pdo.signals]
    wanted: list[Signal] = [*COMMANDS, *ANSWERS]
    if torque.asked:
        wanted.remove("torque")
    if "inputs" not in carried:
        wanted.remove("inputs")
    if len({pdo.pdo for pdo in pdos}) < len(pdos) or len(set(carried)) < len(carried):
        raise ValueError("pdos names a PDO or a signal twice; name each once")
    if complete and set(carried) != set(wanted):
        raise ValueError(f"pdos must carry {', '.join(wanted)}, but carry {', '.join(carried)}")
    carrier = object_of(pdos, "torque")
    if complete and carrier not in (None, object_address(torque.object)):
        raise ValueError(
            f"pdos do not carry {torque.object} as signal torque; correct pdos or torque.object"
        )
