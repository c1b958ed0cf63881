"""Parts of a URDF's joints and links that are not read; they are often typing errors.

A name in another case (`<Limit>`) and a quaternion are refused: without them, defaults would
replace what the file states.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from config.errors import ConfigError
from config.formats.xml_tree import XmlElement

_NO_NAMES: Final[frozenset[str]] = frozenset()
_ATTRIBUTES: Final = {
    "origin": {"xyz", "rpy"},
    "axis": {"xyz"},
    "limit": {
        *("lower", "upper", "velocity", "effort", "acceleration", "deceleration"),
        *("drake:acceleration", "drake:deceleration"),
    },
    "dynamics": {"damping", "friction", "drake:rotor_inertia", "rotor_inertia"},
    "mimic": {"joint", "multiplier", "offset"},
    "safety_controller": {"soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"},
    "mass": {"value"},
    "inertia": {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"},
}
"""Attributes that are read, or that do not affect the motion (the gains of a controller)."""
_CHILDREN: Final = {
    "robot": {"link", "joint", "transmission", "ros2_control", "material", "gazebo", "sensor"},
    "joint": {
        *("parent", "child", "origin", "axis", "limit", "dynamics", "mimic", "safety_controller"),
        "calibration",
    },
    "link": {"inertial", "visual", "collision", "sensor", "gazebo", "self_collision_checking"},
    "inertial": {"origin", "mass", "inertia"},
}


_QUATERNION: Final = "quat"


def refused_parts(root: XmlElement) -> Iterator[ConfigError]:
    """Yield an error for each name in another case, and for each quaternion without rpy."""
    waiting = [root]
    while waiting:
        element = waiting.pop(0)
        known = _CHILDREN.get(element.tag, _NO_NAMES)
        for part in element.children:
            if part.tag not in known and part.tag.lower() in known:
                yield _in_other_case(part, f"<{part.tag}>", f"<{part.tag.lower()}>")
            elif part.tag in _CHILDREN or part.tag in _ATTRIBUTES:
                waiting.append(part)
        own = _ATTRIBUTES.get(element.tag, _NO_NAMES)
        for name in element.attributes:
            if name not in own and name.lower() in own:
                yield _in_other_case(element, f"{name!r} of <{element.tag}>", repr(name.lower()))
            replaces_rpy = element.tag == "origin" and "rpy" not in element.attributes
            if replaces_rpy and name.startswith(_QUATERNION):
                yield ConfigError(
                    f"{element.where}: {name!r} of <origin> cannot be read; state the rotation as"
                    " rpy",
                    code="RID-URDF-STRUCTURE",
                )


def _in_other_case(element: XmlElement, written: str, meant: str) -> ConfigError:
    return ConfigError(
        f"{element.where}: {written} is not a part of a URDF; write {meant}",
        code="RID-URDF-STRUCTURE",
    )


def unread_parts(root: XmlElement) -> tuple[str, ...]:
    """Return one line for each kind of element or attribute that may matter but is not read."""
    found: dict[str, list[str]] = {}
    waiting = [root]
    while waiting:
        element = waiting.pop(0)
        for part in element.children:
            if part.tag not in _CHILDREN.get(element.tag, {part.tag}):
                found.setdefault(f"<{part.tag}> of <{element.tag}>", []).append(part.where)
            elif part.tag in _CHILDREN or part.tag in _ATTRIBUTES:
                waiting.append(part)
        for name in element.attributes if element.tag in _ATTRIBUTES else _NO_NAMES:
            if name not in _ATTRIBUTES[element.tag]:
                found.setdefault(f"{name!r} of <{element.tag}>", []).append(element.where)
    for holder in (root, *root.all("ros2_control")):
        for joint in (each for part in holder.all("transmission") for each in part.all("joint")):
            for offset in joint.all("offset"):
                found.setdefault("<offset> of <joint> in <transmission>", []).append(offset.where)
    return tuple(
        f"{places[0]}: {what} is not read"
        + (f" (nor at {len(places) - 1} more places)" if len(places) > 1 else "")
        for what, places in found.items()
    )
