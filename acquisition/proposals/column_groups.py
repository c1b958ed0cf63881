"""`find_groups`: finds the columns that exist once for each joint, and their quantities."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

QUANTITIES: Final[Mapping[str, frozenset[str]]] = {
    "velocity": frozenset(
        {"qd", "dq", "vel", "velo", "velocity", "velocities", "speed", "qdot", "dtheta", "omega"}
    ),
    "torque": frozenset(
        {"tau", "torque", "torques", "effort", "efforts", "moment", "trq", "trk", "force"}
    ),
    "current": frozenset({"current", "currents", "cur", "amp", "amps", "i", "iq"}),
    "temperature": frozenset({"temp", "temperature", "temperatures"}),
    "position": frozenset({"q", "pos", "position", "positions", "angle", "angles", "theta"}),
}
"""Words in the names of columns by which a quantity is recognised; the first match counts."""

_NOT_MEASURED: Final = frozenset(
    {
        *("target", "desired", "des", "d", "cmd", "command", "commanded", "ref", "reference"),
        *("set", "setpoint", "goal", "planned", "as", "sol", "err", "error", "limit", "min", "max"),
        *("ext", "external", "ej", "ee", "tcp", "cart", "cartesian", "contact", "hat", "filtered"),
        *("acc", "acceleration", "qdd", "ddq", "motor", "voltage", "dtau"),
    }
)
"""Words in the names of columns that are no measurement of a joint."""

_UNIT: Final = re.compile(r"\[([^\]\d]+)\]|\(([^)\d]+)\)")
_WORD: Final = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_LAST_NUMBER: Final = re.compile(r"\d+(?=\D*$)")


@dataclass(frozen=True)
class ColumnGroup:
    """Columns of one quantity, one for each joint.

    Attributes:
        quantity: Key of a joint in an import map.
        columns: Number of the column of each joint, base to flange, counted from 0.
        pattern: Common name of the columns, with `{n}` or `{joint}` in the place of the joint.
        unit: Unit in the name, such as `deg/s`; empty if it states none.
    """

    quantity: str
    columns: tuple[int, ...]
    pattern: str
    unit: str


def find_groups(
    names: Sequence[str], joints: Sequence[str]
) -> tuple[dict[str, ColumnGroup], tuple[str, ...]]:
    """Return the group of columns of each quantity, and doubts, one sentence each.

    The columns of a group have the same name, apart from the number (from 0 or 1) or the name of
    the joint. Columns of targets, commands and external torques are not measurements.

    Args:
        names: Name of each column.
        joints: Names of the robot's joints, base to flange.
    """
    patterns: dict[str, dict[str, int]] = {}
    for column, name in enumerate(names):
        for pattern, place in _patterns(name, joints):
            patterns.setdefault(pattern, {}).setdefault(place, column)
    found: dict[str, list[ColumnGroup]] = {}
    for pattern, places in patterns.items():
        columns = _complete(places, joints)
        quantity = _quantity(pattern)
        known = [group.columns for group in found.get(quantity or "", ())]
        if columns is not None and quantity is not None and columns not in known:
            unit = _UNIT.search(pattern)
            text = next(filter(None, unit.groups()), "") if unit else ""
            found.setdefault(quantity, []).append(ColumnGroup(quantity, columns, pattern, text))
    groups: dict[str, ColumnGroup] = {}
    doubts: list[str] = []
    for quantity, several in found.items():
        several.sort(key=lambda group: len(_words(group.pattern)))
        groups[quantity] = several[0]
        if len(several) > 1:
            others = ", ".join(group.pattern for group in several[1:])
            doubts.append(f"{quantity}: {several[0].pattern} was chosen; other columns: {others}")
    return groups, tuple(doubts)


def _patterns(name: str, joints: Sequence[str]) -> list[tuple[str, str]]:
    """Return the patterns that a name fits, each with the place of the joint in it."""
    found = []
    for joint in sorted(joints, key=len, reverse=True):
        at = re.search(rf"(?<![A-Za-z0-9]){re.escape(joint)}(?![A-Za-z0-9])", name)
        if at:
            found.append((f"{name[: at.start()]}{{joint}}{name[at.end() :]}", joint))
            break
    number = _LAST_NUMBER.search(name)
    if number:
        found.append((f"{name[: number.start()]}{{n}}{name[number.end() :]}", number[0]))
    return found


def _complete(places: Mapping[str, int], joints: Sequence[str]) -> tuple[int, ...] | None:
    """Return the columns in the order of the joints, or None if a joint has none."""
    count = len(joints)
    for labels in (
        tuple(joints),
        tuple(str(number) for number in range(count)),
        tuple(str(number) for number in range(1, count + 1)),
        tuple(f"{number:02d}" for number in range(1, count + 1)),
    ):
        if all(label in places for label in labels) and (labels[0] != "1" or "0" not in places):
            return tuple(places[label] for label in labels)
    return None


def _quantity(pattern: str) -> str | None:
    words = _words(pattern)
    if words & _NOT_MEASURED:
        return None
    return next((name for name, known in QUANTITIES.items() if words & known), None)


def _words(pattern: str) -> frozenset[str]:
    bare = _UNIT.sub("", pattern.replace("{n}", " ").replace("{joint}", " "))
    return frozenset(word.lower() for word in _WORD.findall(bare))
