"""The parts of a URDF's `<joint>`: ends, axis, limits, friction and mimicked joint."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.number import is_infinite
from config.formats.urdf import KINDS, MOVING, Mimic
from config.formats.xml_tree import XmlElement

LIMIT_KEYS: Final = ("lower", "upper", "velocity", "effort", "acceleration", "deceleration")
_SOFT_KEYS: Final = {"soft_lower_limit": "soft_lower", "soft_upper_limit": "soft_upper"}
ROTOR_KEYS: Final = ("drake:rotor_inertia", "rotor_inertia")
SHORTEST_AXIS: Final = 1e-6


def joint_kind(element: XmlElement) -> str:
    """Return a joint's type.

    Raises:
        ConfigError: The type is missing or unknown.
    """
    kind = element.attribute("type")
    if kind not in KINDS:
        raise ConfigError(
            f"{element.where}: unknown joint type {kind!r}; use one of {', '.join(KINDS)}",
            code="RID-URDF-STRUCTURE",
        )
    return kind


def joint_end(element: XmlElement, tag: str) -> str:
    """Return the link that a joint's `<parent>` or `<child>` names.

    Raises:
        ConfigError: The element is missing or names no link.
    """
    end = element.one(tag)
    if end is None:
        raise ConfigError(
            f"{element.where}: the joint has no <{tag}>; add one", code="RID-URDF-STRUCTURE"
        )
    return end.attribute("link")


def joint_axis(element: XmlElement) -> tuple[FloatArray, float]:
    """Return the unit vector of a joint's axis, (3,), and the length of the stated vector.

    The axis is x if none is stated.

    Raises:
        ConfigError: The axis cannot be read, or that of a moving joint has no direction.
    """
    stated = element.one("axis")
    axis = np.array([1.0, 0.0, 0.0])
    if stated is not None:
        axis = np.array(stated.numbers("xyz", 3, (1.0, 0.0, 0.0)))
    length = float(np.linalg.norm(axis))
    if length < SHORTEST_AXIS and element.attributes.get("type") in MOVING:
        raise ConfigError(
            f"{element.where}: the joint's axis has no direction; give xyz of length 1",
            code="RID-URDF-STRUCTURE",
        )
    return axis / max(length, SHORTEST_AXIS), length


def joint_limits(element: XmlElement) -> dict[str, float]:
    """Return the stated limits; a limit is infinite if the file states infinity.

    Raises:
        ConfigError: A limit is not a number.
    """
    limits: dict[str, float] = {}
    stated = element.one("limit")
    for key in LIMIT_KEYS if stated is not None else ():
        for name in (key, f"drake:{key}"):
            if stated is not None and name in stated.attributes:
                limits[key] = _limit(stated, name)
    soft = element.one("safety_controller")
    for name, key in _SOFT_KEYS.items() if soft is not None else ():
        if soft is not None and name in soft.attributes:
            limits[key] = _limit(soft, name)
    return limits


def _limit(element: XmlElement, name: str) -> float:
    text = element.attributes[name]
    if is_infinite(text):
        return -math.inf if text.strip().startswith("-") else math.inf
    return element.number(name)


@dataclass(frozen=True)
class JointDynamics:
    """Friction and rotor of a `<joint>`; None if not stated.

    `damping` is viscous friction [N m s/rad or N s/m], `friction` Coulomb friction [N m or N],
    `rotor_inertia_kg_m2` the inertia of the motor's rotor, before the gear.
    """

    damping: float | None = None
    friction: float | None = None
    rotor_inertia_kg_m2: float | None = None


def joint_dynamics(element: XmlElement) -> JointDynamics:
    """Return friction and rotor inertia from the `<dynamics>` of a joint.

    Raises:
        ConfigError: There are two `<dynamics>`, or a value is negative or not a number.
    """
    stated = element.one("dynamics")
    if stated is None:
        return JointDynamics()
    rotors = [number_not_negative(stated, name) for name in ROTOR_KEYS]
    return JointDynamics(
        damping=number_not_negative(stated, "damping"),
        friction=number_not_negative(stated, "friction"),
        rotor_inertia_kg_m2=next((each for each in rotors if each is not None), None),
    )


def number_not_negative(element: XmlElement, name: str) -> float | None:
    """Return a number that is not negative; None if the attribute is missing.

    Raises:
        ConfigError: The attribute is negative or not a number.
    """
    value = element.optional_number(name)
    if value is not None and value < 0.0:
        raise ConfigError(
            f"{element.where}: {name} of <{element.tag}> is {value:g}; it cannot be negative",
            code="RID-URDF-VALUE",
        )
    return value


def joint_mimic(element: XmlElement) -> Mimic | None:
    """Return the joint that a joint mimics; None if it moves independently.

    Raises:
        ConfigError: `<mimic>` names no joint, or has a number that cannot be read.
    """
    mimic = element.one("mimic")
    if mimic is None:
        return None
    multiplier, offset = (
        mimic.numbers(name, 1, (usual,))[0]
        for name, usual in (("multiplier", 1.0), ("offset", 0.0))
    )
    return Mimic(mimic.attribute("joint"), multiplier, offset)
