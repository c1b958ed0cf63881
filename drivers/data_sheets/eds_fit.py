"""`EdsFit`: keys that a cell file needs to use a drive, found from the drive's data sheet.

If an EDS lacks an object, a key of the axis's `servo` may replace the object; if no key does, the
drive cannot be used. A number that no EDS contains is written as `PLACEHOLDER`; a cell file with a
placeholder is refused until the user has entered the number.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, get_args

from config.cell.cell import CellConfig, DriveAxis
from config.cell.servo_profile import BY_RAMP, Mode, ServoProfile, TorqueObject
from config.formats.eds import ElectronicDataSheet
from config.formats.eds_object import EdsObject, is_signed
from config.formats.yaml_tree import dump_yaml
from config.refusals import PLACEHOLDER
from drivers.canopen.sdo import object_name
from drivers.data_sheets.eds_check import EdsFinding, eds_findings
from drivers.servo.requirements import GUARD_TIME, LIFE_TIME_FACTOR

MOST_LINES = 10
LOOKED_UP: Final = MappingProxyType(
    {
        "encoder_increments": "increments of 6064h per motor revolution, from the data sheet",
        "rated_torque_nm": "N m, from the motor's data sheet",
        "rated_current_a": "A, from the motor's data sheet",
        "torque_constant_nm_per_a": "N m/A, from the motor's data sheet",
        "deceleration_rad_s2": "rad/s² of the joint, as set in the drive by its own tool",
    }
)
"""Keys whose number no EDS contains, with the number's unit and the source from which the user gets
it."""

SAFETY_OBJECTS: Final = frozenset(
    ("100Ch:00", "100Dh:00", "1016h:01", "1017h:00", "6007h:00", "605Ah:00", "605Eh:00", "6040h:00",
     "6041h:00", "6084h:00", "6085h:00")
)  # fmt: skip
"""Objects that protect people. A key can replace only 1016h and 6085h. If 6007h, 605Ah or 605Eh is
missing, the watchdog test must show the drive's reaction."""

_RAMP: Final = "6084h:00"
_MODES: Final[tuple[Mode, ...]] = tuple(mode for mode in get_args(Mode) if mode != "makers")
_OF_MODES = ("6502h:00", "60FFh:00", "607Ah:00", "60C1h:01", "60C2h:01", "60C2h:02", "6083h:00")
_CURRENT_WORDS = ("current", "torque")
_ACTUAL_WORDS = ("actual", "present", "feedback")


@dataclass(frozen=True)
class EdsFit:
    """A servo profile for a drive with a given EDS, with the keys that the cell file adds to it.

    Attributes:
        base: The bundled profile; None for a drive that follows CiA 402 completely.
        added: Profile whose set fields (`added.model_fields_set`) are the added keys.
        findings: Deviations of the EDS that are red even with the added keys.
        mode: The mode in which the drive would be used.
        torque: The object from which the torque is read.
    """

    base: str | None
    added: ServoProfile
    findings: tuple[EdsFinding, ...]
    mode: Mode
    torque: str = "6077h:00"

    @property
    def accepted(self) -> bool:
        """True if the drive can be used, with at most `MOST_LINES` lines in the cell file."""
        return not self.findings and len(self.lines) <= MOST_LINES

    @property
    def keys(self) -> dict[str, object]:
        """Keys and values of the axis's `servo` in the cell file."""
        base: dict[str, object] = {} if self.base is None else {"base": self.base}
        added = self.added.model_dump(mode="json", exclude_unset=True)
        return base | added | {name: PLACEHOLDER for name in LOOKED_UP if name in added}

    @property
    def lines(self) -> tuple[str, ...]:
        """The lines to add to the axis in the cell file, with comments."""
        if not self.keys:
            return ()
        lines = []
        for line in dump_yaml(self.keys).splitlines():
            wanted = LOOKED_UP.get(line.partition(":")[0])
            lines.append(f"  {line}" if wanted is None else f"  {line} # {wanted}")
        return ("servo:", *lines)

    @property
    def reason(self) -> str:
        """Reason why the drive cannot be used; empty if it can be used."""
        missing = [each for each in self.findings if self.protects(each)]
        if missing:
            object_names = ", ".join(f"{each.object_name} ({each.name})" for each in missing)
            return (
                "objects that protect people are missing or unsuitable, and no key replaces them:"
                f" {object_names}"
            )
        if self.torque in [each.object_name for each in self.findings]:
            return "the drive reports neither torque nor current; identification needs one"
        if self.findings:
            object_names = ", ".join(each.object_name for each in self.findings)
            return f"objects of the cyclic exchange are missing or unsuitable: {object_names}"
        if self.accepted:
            return ""
        return f"the cell file would need {len(self.lines)} lines, more than {MOST_LINES}"

    @property
    def concerns_safety(self) -> bool:
        """True if an object that protects people is missing or unsuitable."""
        return any(self.protects(each) for each in self.findings)

    def protects(self, finding: EdsFinding) -> bool:
        """Return True if the object of a finding protects people.

        In profile velocity mode 6084h does not: it is the ramp to the next set-point, not that of a
        stop.
        """
        ramp = finding.object_name == _RAMP and self.mode in BY_RAMP
        return finding.object_name in SAFETY_OBJECTS and not ramp


def fit_eds(
    eds: ElectronicDataSheet,
    cell: CellConfig,
    axis: DriveAxis,
    profiles: dict[str, ServoProfile],
) -> EdsFit:
    """Return the profile with the fewest findings for a drive's EDS.

    Of several, a profile of the maker precedes plain CiA 402; then the fewest added keys decide.

    Args:
        eds: The data sheet.
        cell, axis: The requirements on the drive.
        profiles: The bundled profiles. Those whose vendor is that of the EDS are tried, and plain
            CiA 402.
    """
    makers = {
        name: profile
        for name, profile in profiles.items()
        if profile.vendor is not None and profile.vendor == eds.vendor
    }
    fits = [_fit(eds, cell, axis, name, profile) for name, profile in makers.items()]
    fits.append(_fit(eds, cell, axis, None, ServoProfile()))
    return min(fits, key=lambda fit: (len(fit.findings), fit.base is None, len(fit.keys)))


def _fit(
    eds: ElectronicDataSheet,
    cell: CellConfig,
    axis: DriveAxis,
    base: str | None,
    profile: ServoProfile,
) -> EdsFit:
    """Add keys to a profile until no remaining red finding can be removed by a key."""
    added: dict[str, object] = {}
    torques = list(_torque_candidates(eds))
    while True:
        own = ServoProfile.model_validate(added)
        drive = axis.model_copy(update={"servo": own.on(profile), "velocity_unit": None})
        red = [each for each in eds_findings(eds, cell, drive) if each.verdict == "red"]
        keys: dict[str, object] = {}
        for finding in red:
            keys |= _keys_for(finding, own.on(profile), eds, torques)
        if keys.items() <= added.items():
            used = own.on(profile)
            return EdsFit(base, own, tuple(red), used.mode, used.torque.object)
        added |= keys


def _keys_for(
    finding: EdsFinding,
    profile: ServoProfile,
    eds: ElectronicDataSheet,
    torques: list[TorqueObject],
) -> dict[str, object]:
    """Return the keys that remove a finding; empty if no key can."""
    name, limit = finding.object_name, profile.torque_limit
    keys: dict[str, object] = {}
    if name in ("608Fh:01", "608Fh:02"):
        keys = {"encoder_increments": 4096.0}
    elif name == "6076h:00":
        keys = {"rated_torque_nm": 1.0}
    elif name == "6075h:00":
        keys = {"rated_current_a": 1.0}
    elif name == profile.torque.object and "in N m" in finding.required:
        keys = {"torque_constant_nm_per_a": 1.0}
    elif name == profile.torque.object and torques:
        keys = {"torque": torques.pop(0)}
    elif limit is not None and name == limit.object:
        keys = _limit_keys(profile, eds)
    elif name == "1016h:01" and all(eds.get(*each) for each in (GUARD_TIME, LIFE_TIME_FACTOR)):
        keys = {"watch": "life_guarding"}
    elif name == "6085h:00":
        keys = {"deceleration_rad_s2": 10.0}
    elif name.startswith("60C2h") and profile.by_position:
        keys = {"cycle_time_written": False}
    elif name in _OF_MODES and profile.mode in _MODES[:-1]:
        keys = {"mode": _MODES[_MODES.index(profile.mode) + 1]}
    elif any(name == extra.object for extra in profile.settings):
        kept = tuple(extra for extra in profile.settings if extra.object != name)
        keys = {"settings": kept}
    return keys


def _limit_keys(profile: ServoProfile, eds: ElectronicDataSheet) -> dict[str, object]:
    """Return keys for a torque limit that is not writable: read it, use 6073h, or omit it."""
    limit = profile.torque_limit
    assert limit is not None
    if profile.torque_limit_written and _readable(eds, limit.object, limit.bits):
        return {"torque_limit_written": False}
    current = TorqueObject(object="6073h:00", of="rated_current")
    if limit.object != current.object and _readable(eds, current.object, current.bits):
        return {"torque_limit": current, "torque_limit_written": False}
    return {"torque_limit": None}


def _readable(eds: ElectronicDataSheet, name: str, bits: int) -> bool:
    index, subindex = name.split("h:")
    found = eds.get(int(index, 16), int(subindex, 16))
    return found is not None and found.bits == bits and not found.faults


def _torque_candidates(eds: ElectronicDataSheet) -> Iterator[TorqueObject]:
    """Yield candidates for the torque object: those of CiA 402, then others with a suitable name.

    Objects that cannot be mapped into a PDO come last, because they must be read by SDO.
    """
    standard = {0x6077: "rated_torque", 0x6078: "rated_current"}
    candidates = sorted(
        (item for item in torque_objects(eds) if _fits_answer(item) or _can_be_asked(item)),
        key=lambda item: (not _fits_answer(item), item.index not in standard, item.index),
    )
    for item in candidates:
        keys: dict[str, object] = {
            "object": object_name(item.index, item.subindex),
            "of": standard.get(item.index, "ampere"),
        }
        if not _fits_answer(item):
            keys |= {"bits": item.bits, "asked": True}
        yield TorqueObject.model_validate(keys)


def torque_objects(eds: ElectronicDataSheet) -> tuple[EdsObject, ...]:
    """Return the objects of any size whose names say that they are an actual torque or current."""
    return tuple(item for item in eds.objects if _is_actual_torque(item.name.lower()))


def _is_actual_torque(words: str) -> bool:
    named = any(word in words for word in _CURRENT_WORDS)
    return named and any(word in words for word in _ACTUAL_WORDS)


def _fits_answer(item: EdsObject) -> bool:
    signed = item.data_type is not None and is_signed(item.data_type)
    return item.bits == 16 and signed and item.mappable and item.sendable


def _can_be_asked(item: EdsObject) -> bool:
    signed = item.data_type is not None and is_signed(item.data_type)
    return item.bits in (16, 32) and signed and not item.faults
