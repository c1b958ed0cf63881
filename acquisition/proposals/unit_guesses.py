"""`possible_units`: units that the columns of a recording can have."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Final

from acquisition.maps.import_units import ImportUnits
from acquisition.proposals.column_groups import UNITS, ColumnGroup
from acquisition.proposals.known_sources import KnownSource

_VELOCITY_UNITS: Final = {
    "rad": "rad/s", "deg": "deg/s", "rev": "rpm", "increments": "increments/s", "m": "m/s",
    "mm": "mm/s",
}  # fmt: skip
_RADIANS: Final = {"rad": 1.0, "deg": math.pi / 180.0, "rev": 2.0 * math.pi}
_RADIANS_PER_S: Final = {"rad/s": 1.0, "deg/s": math.pi / 180.0, "rpm": math.pi / 30.0}


def velocity_scale(units: Mapping[str, str]) -> float | None:
    """Return the unit of velocities relative to that of positions [1/s]; None if one is unknown.

    Positions and velocities that contradict each other do so in all pairs of units with one scale.
    """
    position = _RADIANS.get(units["position"])
    velocity = _RADIANS_PER_S.get(units.get("velocity", ""))
    return None if position is None or velocity is None else round(velocity / position, 9)


def possible_units(
    groups: Mapping[str, ColumnGroup], source: KnownSource | None
) -> Iterator[dict[str, str]]:
    """Yield the possible units, the likeliest first."""
    given = {} if source is None else dict(source.units)
    stated = {name: unit_in_name(group) for name, group in groups.items()}
    fixed = {name: unit for name, unit in stated.items() if unit} | given
    positions = [fixed["position"]] if "position" in fixed else ["rad", "deg", "rev"]
    for position in positions:
        likely = _VELOCITY_UNITS[position]
        velocities = [fixed.get("velocity", likely)]
        if "velocity" in groups and "velocity" not in fixed:
            velocities += [each for each in ("rad/s", "deg/s", "rpm") if each != likely]
        for velocity in velocities:
            units = {"position": position}
            if "velocity" in groups:
                units["velocity"] = velocity
            for quantity in ("torque", "current", "temperature"):
                if quantity in fixed and (quantity != "current" or "torque" not in groups):
                    units[quantity] = fixed[quantity]
            yield units


def unit_in_name(group: ColumnGroup) -> str:
    """Return the unit that the name of a group states, as a map writes it."""
    if group.unit in UNITS[group.quantity]:
        return UNITS[group.quantity][group.unit]
    words = set(re.split(r"[^A-Za-z]+", group.pattern.lower()))
    if group.quantity in ("position", "velocity") and words & {"deg", "degree", "degrees"}:
        return {"position": "deg", "velocity": "deg/s"}[group.quantity]
    if group.quantity in ("position", "velocity") and words & {"rad", "radian", "radians"}:
        return {"position": "rad", "velocity": "rad/s"}[group.quantity]
    return ""


def find_assumed_units(
    units: Mapping[str, str], groups: Mapping[str, ColumnGroup], source: KnownSource | None
) -> dict[str, str]:
    """Return the units that the column names do not state; none for a known program."""
    known = {} if source is None else source.units
    default = ImportUnits().model_dump() | dict(units)
    used = [name for name in groups if name != "current" or "torque" not in groups]
    return {
        name: str(default[name])
        for name in used
        if source is None and not unit_in_name(groups[name]) and name not in known
    }
