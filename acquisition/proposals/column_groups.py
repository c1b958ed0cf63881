"""`find_groups`: finds the columns that exist once for each joint, and their quantities."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

QUANTITIES: Final[Mapping[str, frozenset[str]]] = {
    "velocity": frozenset(
        {"qd", "dq", "vel", "velo", "velocity", "velocities", "speed", "qdot", "dtheta", "omega"}
        | {"geschwindigkeit", "drehzahl", "istgeschwindigkeit", "istdrehzahl"}
    ),
    "torque": frozenset(
        {"tau", "torque", "torques", "effort", "efforts", "moment", "trq", "trk", "force"}
        | {"drehmoment", "istmoment", "istdrehmoment"}
    ),
    "current": frozenset(
        {"current", "currents", "cur", "amp", "amps", "i", "iq", "strom", "iststrom", "motorstrom"}
    ),
    "temperature": frozenset({"temp", "temperature", "temperatures"}),
    "position": frozenset(
        {"q", "pos", "position", "positions", "angle", "angles", "theta"}
        | {"winkel", "achswinkel", "istposition", "istwinkel"}
    ),
}
"""Words in the names of columns by which a quantity is recognised; the first match counts."""

_NOT_MEASURED: Final = frozenset(
    {
        *("target", "desired", "des", "d", "cmd", "command", "commanded", "ref", "reference"),
        *("set", "setpoint", "goal", "planned", "as", "sol", "err", "error", "limit", "min", "max"),
        *("ext", "external", "ej", "ee", "tcp", "cart", "cartesian", "contact", "hat", "filtered"),
        *("acc", "acceleration", "qdd", "ddq", "voltage", "dtau"),
        *("disturb", "disturbance", "dist"),  # what an observer estimates, not the torque
    }
)
"""Words in the names of columns that do not measure a joint."""

_MOTION: Final = ("position", "velocity")
_CURRENT_AS_TORQUE: Final = frozenset({"actual", "current", "as", "torque"})
"""Words of `actual_current_as_torque` of Universal Robots, a measured torque."""

_PERMILLE: Final = ("permille", "per mille", "‰", "0.1%", "0.1 %", "0,1 %", "1/1000")

UNITS: Final[Mapping[str, Mapping[str, str]]] = {
    "position": {
        **dict.fromkeys(("rad", "radian", "radians"), "rad"),
        **dict.fromkeys(("deg", "°", "degree", "degrees"), "deg"),
        **dict.fromkeys(("rev", "turns"), "rev"),
        **dict.fromkeys(("inc", "increments", "counts", "cnt", "ticks"), "increments"),
        "m": "m",
        "mm": "mm",
    },
    "velocity": {
        **dict.fromkeys(("rad/s", "rad/sec"), "rad/s"),
        **dict.fromkeys(("deg/s", "°/s", "deg/sec"), "deg/s"),
        **dict.fromkeys(("rpm", "1/min", "U/min", "rev/min"), "rpm"),
        **dict.fromkeys(("inc/s", "increments/s", "counts/s", "cnt/s", "ticks/s"), "increments/s"),
        "m/s": "m/s",
        "mm/s": "mm/s",
    },
    "torque": {
        **dict.fromkeys(("Nm", "N m", "N*m", "N·m", "N.m", "N-m"), "Nm"),
        **dict.fromkeys(_PERMILLE, "permille"),
        **dict.fromkeys(("percent", "%"), "percent"),
        "mNm": "mNm",
        "N": "N",
    },
    "current": {
        **dict.fromkeys(_PERMILLE, "permille"),
        **dict.fromkeys(("percent", "%"), "percent"),
        "A": "A",
        "mA": "mA",
    },
    "temperature": {"C": "C", "°C": "C", "K": "K"},
}
"""Units in the names of columns of each quantity, and as an import map writes them."""

TIME_UNITS: Final = {
    **dict.fromkeys(("min", "minute", "minutes"), "min"),
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("ms", "msec", "msecs", "millisecond", "milliseconds"), "ms"),
    **dict.fromkeys(("us", "µs", "μs", "usec", "microsecond", "microseconds"), "us"),
    **dict.fromkeys(("ns", "nsec", "nanosecond", "nanoseconds"), "ns"),
}
"""Units in the names of columns of time stamps, and as an import map writes them."""

_SHOWS_QUANTITY: Final = ("position", "velocity", "torque", "current")

_UNIT: Final = re.compile(
    r"\[([^\]\d]+|1/min|0[.,]1 ?%|1/1000)\]|\(([^)\d]+|1/min|0[.,]1 ?%|1/1000)\)"
)
_WORD: Final = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_LAST_NUMBER: Final = re.compile(r"\d+(?=\D*$)")


@dataclass(frozen=True)
class ColumnGroup:
    """Columns of one quantity, one for each joint.

    Attributes:
        quantity: Key of a joint in an import map.
        columns: Number of the column of each joint, base to flange, counted from 0.
        pattern: Common name of the columns, with `{n}` or `{joint}` instead of the joint.
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
    found: dict[str, list[ColumnGroup]] = {}
    more: dict[str, str] = {}
    for pattern, places in _places(names, joints).items():
        columns = _complete(places, joints)
        quantity = _quantity(pattern)
        known = [group.columns for group in found.get(quantity or "", ())]
        if columns is not None and quantity is not None and columns not in known:
            group = ColumnGroup(quantity, columns, pattern, unit_in(pattern))
            found.setdefault(quantity, []).append(group)
            more[pattern] = ", ".join(names[n] for n in places.values() if n not in columns)
    groups: dict[str, ColumnGroup] = {}
    doubts: list[str] = []
    for quantity, several in found.items():
        several.sort(key=lambda group: len(_words(group.pattern)))
        groups[quantity] = several[0]
        if len(several) > 1:
            others = ", ".join(group.pattern for group in several[1:])
            doubts.append(f"{quantity}: {several[0].pattern} was chosen; other columns: {others}")
        if more[several[0].pattern]:
            doubts.append(
                f"{quantity}: {more[several[0].pattern]} is not used, because the robot has"
                f" {len(joints)} joints: is it the robot that moved?"
            )
    return groups, tuple(doubts)


def incomplete_groups(names: Sequence[str], joints: Sequence[str]) -> tuple[str, ...]:
    """Return the patterns that lack a column for some joints, each with its number of columns.

    Only patterns of positions, velocities, torques and currents count.
    """
    return tuple(
        f"{pattern} ({len(places)})"
        for pattern, places in _places(names, joints).items()
        if len(places) > 1
        and _quantity(pattern) in _SHOWS_QUANTITY
        and _complete(places, joints) is None
    )


def _places(names: Sequence[str], joints: Sequence[str]) -> dict[str, dict[str, int]]:
    """Return, for each pattern, the column of each joint's number or name."""
    patterns: dict[str, dict[str, int]] = {}
    for column, name in enumerate(names):
        for pattern, place in _patterns(name, joints):
            patterns.setdefault(pattern, {}).setdefault(place, column)
    return patterns


def _patterns(name: str, joints: Sequence[str]) -> list[tuple[str, str]]:
    """Return the patterns that a column's name fits, each with the joint's number or name in it."""
    found = []
    for joint in sorted(joints, key=len, reverse=True):
        at = re.search(rf"(?<![A-Za-z0-9]){re.escape(joint)}(?![A-Za-z0-9])", name)
        if at:
            found.append((f"{name[: at.start()]}{{joint}}{name[at.end() :]}", joint))
            break
    number = _LAST_NUMBER.search(_UNIT.sub(lambda unit: " " * len(unit[0]), name))
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
    if words == _CURRENT_AS_TORQUE:
        return "torque"
    if words & _NOT_MEASURED:
        return None
    if any(word.startswith("soll") for word in words):
        return None
    named = next((name for name, known in QUANTITIES.items() if words & known), None)
    if named in _MOTION and "motor" in words:
        return None  # before the gear
    unit = unit_in(pattern)
    by_unit = [name for name in _SHOWS_QUANTITY if unit in UNITS[name]]
    return named or (by_unit[0] if len(by_unit) == 1 else None)


def unit_in(pattern: str) -> str:
    """Return the text in brackets in a column's name, without the number of a joint."""
    found = _UNIT.search(pattern.replace("[{n}]", "").replace("({n})", ""))
    return next(filter(None, found.groups()), "").strip() if found else ""


def _words(pattern: str) -> frozenset[str]:
    bare = _UNIT.sub("", pattern.replace("{n}", " ").replace("{joint}", " "))
    return frozenset(word.lower() for word in _WORD.findall(bare))
