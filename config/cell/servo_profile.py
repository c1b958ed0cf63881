"""`ServoProfile`: which objects a family of servo drives uses, and what their numbers mean.

Data, so that another maker's drive is another file. What a drive must hold before motion stands in
`drivers/servo/requirements.py`; this is what differs between drives that keep to CiA 402.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

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
from config.robot.robot import Positive

Unsigned32 = Annotated[int, Field(ge=0, lt=2**32)]
FamilyObject = Annotated[str, Field(pattern=r"^[0-9A-F]{4}h(:[0-9A-F]{2})?$")]
Mode = Literal[
    "cyclic_velocity", "profile_velocity", "cyclic_position", "interpolated_position", "makers"
]
VelocityUnit = Literal["increments_per_s", "rpm", "0.1rpm"]
Watch = Literal["heartbeat", "life_guarding"]
Units = Annotated[Positive, Plausible(1e-9, 1e9, "")]

BY_POSITION: Final[tuple[Mode, ...]] = ("cyclic_position", "interpolated_position")

_STATUSWORD: Final = "6041h:00"
_MAKERS_STATUS_BITS: Final = 1 << 8 | 1 << 14 | 1 << 15
_INCREMENTS: Final = ("increments_per_s", 1.0)
RATINGS_AGREE: Final = 1.6
"""By which factor the torque constant may differ from rated torque over rated current."""
_TENTHS: Final = {"0.1rpm": 10.0}


BY_RAMP: Final[tuple[Mode, ...]] = ("profile_velocity", "makers")
"""Modes in which the drive's own ramp, by 6083h and 6084h, leads to each velocity."""


class TorqueObject(ConfigModel):
    """An object that holds a torque or a current.

    `units` of its numbers are the rated torque, the rated current, or one ampere. `asked`: no PDO
    can carry it, and it is asked for by SDO after every SYNC.
    """

    object: ObjectName
    of: Literal["rated_torque", "rated_current", "ampere"] = "rated_torque"
    units: Units = 1000.0
    bits: Literal[16, 32] = 16
    asked: bool = False


class ExtraSetting(ConfigModel):
    """An object of the maker's, or of an older profile, that must hold a value.

    With `written: false` it is left to the drive to be right.
    """

    object: ObjectName
    bits: Literal[8, 16, 32]
    value: Annotated[int, Field(ge=-(2**31), lt=2**32)]
    written: bool = True


class ReferencedBits(ConfigModel):
    """Bits of an object that say that a drive has been homed since its encoder lost its position.

    The drive is referenced if the object, masked by `mask`, is `value`; without `value`, if all
    bits of the mask are set. Of 6041h only bits 8, 14 and 15 can be used: CiA 402 leaves no other
    to the manufacturer, and bit 12 means "homing attained" in homing mode alone.
    """

    object: ObjectName
    bits: Literal[8, 16, 32] = 16
    mask: Annotated[int, Field(gt=0, lt=2**32)]
    value: Unsigned32 | None = None

    @model_validator(mode="after")
    def _within_object(self) -> Self:
        if self.mask >> self.bits:
            raise ValueError(f"mask {self.mask} does not fit the object's {self.bits} bits")
        if self.wanted & ~self.mask:
            raise ValueError(f"value {self.wanted} has bits outside mask {self.mask}")
        if self.object == _STATUSWORD and self.mask & ~_MAKERS_STATUS_BITS:
            raise ValueError(
                f"mask {self.mask} of 6041h uses bits that CiA 402 defines; use bit 8 (256),"
                " 14 (16384) or 15 (32768), by the drive's manual, or another object"
            )
        return self

    @property
    def wanted(self) -> int:
        """The masked bits of a drive that is referenced."""
        return self.mask if self.value is None else self.value


class ServoProfile(ConfigModel):
    """One family of drives, or what a cell file adds for one drive.

    Keys that are left out are those of `base`, a bundled profile; without it, what CiA 402 says.

    `mode` is one of CiA 402's: 9, 3, 8 or 7 in 6060h; or the maker's own -1, in which `pdos` say
    what is told a velocity. A drive that follows positions is told the sum of its velocities, in
    increments.
    `encoder_increments`, units of 6064h in a motor revolution, stand for 608Fh; `rated_torque_nm`
    for 6076h, of whose numbers `rated_torque_units` are 1 N m; `rated_current_a` for 6075h. A drive
    that tells a current in place of a torque needs `torque_constant_nm_per_a`, the motor's.

    `velocity_units` of 60FFh are one `velocity_unit`; `acceleration_units` of 6083h to 6085h are
    one `acceleration_unit` per second, as those of velocity where they are left out.

    `torque` goes into the answer of every cycle. `torque_limit` is written to what the cell's
    `drive_safety` says, or, with `torque_limit_written: false`, read and shown; null: there is
    none. `deceleration_rad_s2` is the joint's where the drive has no 6085h that could be set.

    `commands` are taken up at the next SYNC, or, of a drive whose RPDOs know no SYNC, when they
    come. `pdos` are those of a drive that does not let them be mapped; they are used as they are.

    `cycle_time_written: false` is for a drive that takes the period of its set-points from SYNC, or
    from its own tool: 60C2h is then compared if it has it, and not written.

    `enable_timeout_s` is how long the drive may take from Switch On Disabled to Operation Enabled,
    brakes and precharge included. `follows_bit: false` is for a drive that never sets bit 12 of
    6041h (drive follows the command value).

    `referenced` names the bits that say that the drive has been homed. A drive that says that it is
    not is refused; without the key, nothing is known of it.

    `watch` is how drive and computer notice each other's silence: by heartbeats (1016h, 1017h), or,
    of a drive without 1016h, by life guarding (100Ch, 100Dh), in which it is asked for its state.

    A simulated drive of the family lacks the objects of `lacks`, does not let those of `read_only`
    be written, and has those of `settings` besides.
    """

    base: str | None = Field(default=None, min_length=1)
    vendor: Unsigned32 | None = None
    mode: Mode = "cyclic_velocity"
    encoder_increments: Annotated[Positive, Plausible(4.0, 4.3e9, "")] | None = None
    velocity_unit: VelocityUnit = "increments_per_s"
    velocity_units: Units = 1.0
    acceleration_unit: VelocityUnit | None = None
    acceleration_units: Units | None = None
    rated_torque_nm: Annotated[Positive, Plausible(1e-3, 5e3, "N m")] | None = None
    rated_torque_units: Units = 1000.0
    rated_current_a: Annotated[Positive, Plausible(1e-2, 2e3, "A")] | None = None
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
    referenced: ReferencedBits | None = None
    watch: Watch = "heartbeat"
    settings: tuple[ExtraSetting, ...] = ()
    lacks: tuple[FamilyObject, ...] = ()
    read_only: tuple[ObjectName, ...] = ()

    @model_validator(mode="after")
    def _mappable(self) -> Self:
        if self.torque.bits != 16 and not (self.torque.asked or self.pdos):
            raise ValueError("torque goes into an answer of 8 bytes: bits must be 16")
        if self.by_position and (self.velocity_unit, self.velocity_units) != _INCREMENTS:
            raise ValueError("a drive that follows positions is told increments: no velocity_unit")
        if self.mode == "makers" and not (self.pdos or self.base):
            raise ValueError("mode makers: name the PDO that is told the velocity, in pdos")
        _check_ratings(self.rated_torque_nm, self.rated_current_a, self.torque_constant_nm_per_a)
        if self.pdos:
            _check_pdos(self.pdos, self.torque, complete=self.base is None)
        return self

    def on(self, base: ServoProfile) -> ServoProfile:
        """Return this profile with what it leaves out taken from another."""
        said = {name: getattr(self, name) for name in self.model_fields_set}
        return base.model_copy(update=said | {"base": None})

    @property
    def spread(self) -> bool:
        """Whether what a cycle tells of the drive comes in more than one frame."""
        return bool(self.pdos) or self.torque.asked

    @property
    def by_ramp(self) -> bool:
        """Whether the drive's own ramp leads to each velocity."""
        return self.mode in BY_RAMP

    @property
    def by_position(self) -> bool:
        """Whether the drive is told positions."""
        return self.mode in BY_POSITION

    @property
    def sets_increments(self) -> bool:
        """Whether 608Fh is set, as a factor, and does not tell the encoder."""
        return any(extra.object.startswith("608Fh") for extra in self.settings)

    @property
    def velocity_per_increment(self) -> tuple[float, float]:
        """Units of 60FFh per increment/s and per rpm; one of them is 0."""
        return _per(self.velocity_unit, self.velocity_units)

    @property
    def acceleration_per_increment(self) -> tuple[float, float]:
        """Units of 6085h per increment/s² and per rpm/s; one of them is 0."""
        unit = self.acceleration_unit or self.velocity_unit
        units = self.velocity_units if self.acceleration_unit is None else 1.0
        return _per(unit, self.acceleration_units or units)


def _per(unit: VelocityUnit, units: float) -> tuple[float, float]:
    if unit == "increments_per_s":
        return units, 0.0
    return 0.0, units * _TENTHS.get(unit, 1.0)


def _check_ratings(torque: float | None, current: float | None, constant: float | None) -> None:
    """Refuse three ratings of a motor of which one contradicts the others.

    The torque constant is the rated torque over the rated current, but for the motor's losses.
    """
    if torque is None or current is None or constant is None:
        return
    if not 1.0 / RATINGS_AGREE <= constant * current / torque <= RATINGS_AGREE:
        raise ValueError(
            f"the motor's ratings contradict one another: {torque:g} N m / {current:g} A ="
            f" {torque / current:.3g} N m/A, not {constant:g} N m/A; correct the wrong one by the"
            " motor's data sheet (effective and peak values differ by 1.41)"
        )


def _check_pdos(pdos: tuple[FixedPdo, ...], torque: TorqueObject, *, complete: bool) -> None:
    carried = [signal for pdo in pdos for signal in pdo.signals]
    wanted: list[Signal] = [*COMMANDS, *ANSWERS]
    if torque.asked:
        wanted.remove("torque")
    if len({pdo.pdo for pdo in pdos}) < len(pdos) or len(set(carried)) < len(carried):
        raise ValueError("pdos: each PDO, and each signal, is named once")
    if complete and set(carried) != set(wanted):
        raise ValueError(f"pdos must carry {', '.join(wanted)}; they carry {', '.join(carried)}")
    told = object_of(pdos, "torque")
    if complete and told not in (None, object_address(torque.object)):
        raise ValueError(f"pdos: the torque is {torque.object}, which they do not carry as such")
