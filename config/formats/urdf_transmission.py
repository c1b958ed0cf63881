"""Gears and rotors from a URDF's `<transmission>` elements, by joint."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

from config.errors import ConfigError
from config.formats.number import NUMBER_CODE, parse_number
from config.formats.urdf_joint import ROTOR_KEYS, number_not_negative
from config.formats.xml_tree import XmlElement

_REDUCTIONS: Final = ("mechanicalReduction", "mechanical_reduction")
_DRAKE_RATIO: Final = "drake:gear_ratio"
_LARGEST_RATIO: Final = 1e6


@dataclass(frozen=True)
class Transmissions:
    """Gear ratios and rotor inertias [kg m²] by joint, and errors.

    Attributes:
        ratios: Motor turns per joint turn; negative if the motor turns against its joint.
        unread: Reductions that are not the ratio of one joint, as written in the file.
        rotors_kg_m2: The rotors' inertias, before the gear.
        errors: Values that cannot be read, and second transmissions of a joint.
    """

    ratios: dict[str, float] = field(default_factory=dict)
    unread: dict[str, str] = field(default_factory=dict)
    rotors_kg_m2: dict[str, float] = field(default_factory=dict)
    errors: list[ConfigError] = field(default_factory=list)


def transmissions_of(root: XmlElement) -> Transmissions:
    """Return the gears and rotors of a URDF.

    Only transmissions of a single joint are read: the values in the transmission itself (the
    oldest form), in its actuator or its joint, in <ros2_control>, and in Drake's elements.
    """
    found = Transmissions()
    places: dict[str, str] = {}
    holders = [root, *root.all("ros2_control")]
    for element in (each for holder in holders for each in holder.all("transmission")):
        joints = [part for part in element.all("joint") if "name" in part.attributes]
        names = [part.attributes["name"] for part in joints]
        stated = list(_stated_reductions(element))
        rotors = [part for held in _parts(element) for key in ROTOR_KEYS for part in held.all(key)]
        try:
            for name in names if stated or rotors else ():
                if name in places:
                    raise ConfigError(
                        f"{element.where}: a second transmission of joint {name!r}; the first is"
                        f" at {places[name]}; remove one",
                        code="RID-FILE-DUPLICATE",
                    )
                places[name] = element.where
            ratio = _ratio(*stated[0]) if len(stated) == len(joints) == 1 else None
            for name in names if stated else ():
                if ratio is not None:
                    found.ratios[name] = ratio
                else:
                    found.unread[name] = " ".join(text for _, text in stated)
            for name in names if len(rotors) == len(names) == 1 else ():
                rotor = number_not_negative(rotors[0], "value")
                if rotor is not None:
                    found.rotors_kg_m2[name] = rotor
        except ConfigError as error:
            found.errors.append(error)
    return found


def _parts(element: XmlElement) -> tuple[XmlElement, ...]:
    return (element, *element.all("joint"), *element.all("actuator"))


def _stated_reductions(element: XmlElement) -> Iterator[tuple[XmlElement, str]]:
    """Yield the reductions of a transmission, and the elements that contain them."""
    for holder in _parts(element):
        for tag in _REDUCTIONS:
            yield from ((part, part.text) for part in holder.all(tag))
        for part in holder.all(_DRAKE_RATIO):
            yield part, part.attributes.get("value", "")


def _ratio(element: XmlElement, text: str) -> float | None:
    """Return a reduction; None if it is empty or 0.

    Raises:
        ConfigError: The reduction is not a number, or is too large for a gear.
    """
    if not text.strip():
        return None
    try:
        ratio = parse_number(text)
    except ConfigError as error:
        raise ConfigError(
            f"{element.where}: the reduction of <{element.tag}> {error}", code=NUMBER_CODE
        ) from None
    if abs(ratio) >= _LARGEST_RATIO:
        raise ConfigError(
            f"{element.where}: a reduction of {ratio:g} is too large for a gear; correct it",
            code="RID-URDF-GEAR",
        )
    return ratio if ratio != 0.0 else None
