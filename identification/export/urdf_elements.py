"""Changes of `<inertial>` and `<dynamics>` in a URDF's text.

The text of an attribute that already has the new value is not changed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.number import parse_number
from config.formats.xml_edit import STEP, XmlEditor
from config.formats.xml_tree import XmlElement
from identification.consistency.rigid_body import LinkBody
from identification.export.text import numbers

UNCHANGED: Final = 1e-8
"""Largest relative difference of a value whose text is kept."""
SMALLEST_LENGTH_M: Final = 1e-3
_ELEMENTS: Final = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def write_inertial(editor: XmlEditor, link: XmlElement, body: LinkBody) -> None:
    """Set a link's mass, centre and inertia.

    Args:
        editor: The file.
        link: The element `<link>`.
        body: The values in the link's frame. The axes of `<inertial>` become those of the link.
    """
    inertia = body.inertia_kg_m2[np.triu_indices(3)]
    length_m = max(float(np.linalg.norm(body.centre_m)), SMALLEST_LENGTH_M)
    parts = {
        "origin": {"xyz": (body.centre_m, length_m), "rpy": (np.zeros(3), 1e-8)},
        "mass": {"value": (np.array([body.mass_kg]), body.mass_kg)},
        "inertia": {
            name: (np.array([value]), float(np.trace(body.inertia_kg_m2)))
            for name, value in zip(_ELEMENTS, inertia, strict=True)
        },
    }
    found = link.one("inertial")
    if found is not None and found.children:
        for tag, values in parts.items():
            _write(editor, found, tag, values)
        return
    lines = [_new_tag(tag, values) for tag, values in parts.items()]
    if found is not None:
        editor.insert_first(found, lines)
    else:
        editor.insert_first(link, ["<inertial>", *(STEP + line for line in lines), "</inertial>"])


def write_dynamics(editor: XmlEditor, joint: XmlElement, damping: float, friction: float) -> None:
    """Set a joint's viscous and Coulomb friction; other attributes of `<dynamics>` stay."""
    _write(
        editor,
        joint,
        "dynamics",
        {
            "damping": (np.array([damping]), damping),
            "friction": (np.array([friction]), friction),
        },
    )


_Values = Mapping[str, tuple[FloatArray, float]]
"""By attribute: the numbers to write, and a magnitude; smaller differences than `UNCHANGED` times
this magnitude leave the attribute's text as it is."""


def _write(editor: XmlEditor, parent: XmlElement, tag: str, values: _Values) -> None:
    found = parent.one(tag)
    if found is None:
        editor.insert_last(parent, [_new_tag(tag, values)])
        return
    changed = {
        name: numbers(wanted, " ")
        for name, (wanted, size) in values.items()
        if not _has(found, name, wanted, UNCHANGED * size)
    }
    if changed:
        editor.set_attributes(found, changed)


def _has(element: XmlElement, name: str, wanted: FloatArray, tolerance: float) -> bool:
    """Return True if an attribute already has the new numbers; a missing number counts as zero."""
    if name not in element.attributes:
        return not np.any(wanted)
    try:
        stated = [parse_number(word) for word in element.attributes[name].split()]
    except ConfigError:
        return False
    return len(stated) == len(wanted) and bool(np.abs(np.array(stated) - wanted).max() <= tolerance)


def _new_tag(tag: str, values: _Values) -> str:
    words = " ".join(f'{name}="{numbers(wanted, " ")}"' for name, (wanted, _) in values.items())
    return f"<{tag} {words}/>"
