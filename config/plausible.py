"""`Plausible`: the range in which a physical value of a real robot lies.

A field declares its range in its type, `Annotated[float, Plausible(0.0, 6.3, "rad")]`; the range is
checked when a file is loaded. A value outside is often in another unit; the message names that unit
if it knows one that fits.
"""

from __future__ import annotations

import difflib
import math
import types
import typing
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final

from pydantic import BaseModel, GetJsonSchemaHandler, RootModel
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from config.model import ConfigModel

ON_PURPOSE: Final = "implausible_on_purpose"
ZERO_CELSIUS_K: Final = 273.15

_DEGREE: Final = math.pi / 180.0
_GYRATION: Final = "m (root of moments of inertia over twice the mass)"
SPEED_UP_UNIT: Final = "s (velocity over acceleration)"
SLIDE_UP_UNIT: Final = "s (velocity over acceleration of a prismatic joint)"
_OTHER_UNITS: Final[dict[str, dict[str, float]]] = {
    "rad": {"degrees": _DEGREE},
    "rad/s": {"degrees/s": _DEGREE, "rpm": math.pi / 30.0},
    "rad/s²": {"degrees/s²": _DEGREE},
    "m": {"mm": 1e-3},
    "m/s": {"mm/s": 1e-3},
    "m/s²": {"cm/s²": 1e-2, "mm/s²": 1e-3},
    "m/s³": {"mm/s³": 1e-3},
    "kg": {"g": 1e-3},
    "kg m²": {"kg cm²": 1e-4, "kg mm²": 1e-6, "g mm²": 1e-9},
    "N": {"kN": 1e3, "mN": 1e-3},
    "N m": {"N mm": 1e-3, "kN m": 1e3},
    "N m s/rad": {"N mm s/rad": 1e-3},
    "N m/A": {"N mm/A": 1e-3},
    "N/m": {"N/mm": 1e3},
    "s": {"ms": 1e-3, "µs": 1e-6},
    "Hz": {"kHz": 1e3, "mHz": 1e-3},
    "1/s": {"1/ms": 1e3, "1/min": 1.0 / 60.0},
    "%": {"parts of 1": 100.0},
    "rev": {"degrees": 1.0 / 360.0, "rad": 0.5 / math.pi},
    "mm": {"m": 1e3, "µm": 1e-3},
    "pC/N": {"nC/N": 1e3},
    SPEED_UP_UNIT: {"with an acceleration in degrees/s²": 1.0 / _DEGREE},
    SLIDE_UP_UNIT: {"with an acceleration in mm/s²": 1e3},
    _GYRATION: {
        "with a mass in g": 1e3**0.5,
        "with an inertia in kg cm²": 1e-2,
        "with an inertia in kg mm²": 1e-3,
        "with an inertia in g mm²": 1e-4 * 0.1**0.5,
    },
}


@dataclass(frozen=True)
class Plausible:
    """Range of magnitudes from `low` to `high`; zero is plausible too, unless `zero` is False.

    The magnitude of a vector is its length.

    Attributes:
        low, high: The smallest and the largest magnitude.
        unit: Unit of the value; empty for a ratio.
        prismatic: The range for a prismatic joint, if that has another unit.
        zero: True if zero is plausible.
    """

    low: float
    high: float
    unit: str
    prismatic: Plausible | None = None
    zero: bool = True

    def __str__(self) -> str:
        """Return the range in words, for the reference."""
        words = f"plausible {self.low:g} to {self.high:g} {self.unit}".rstrip()
        return f"{words}, prismatic {str(self.prismatic)[10:]}" if self.prismatic else words

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Add the range in words to the JSON schema."""
        return {**handler(schema), "plausible": str(self)}

    def holds(self, size: float) -> bool:
        """Return whether a magnitude is plausible."""
        return (size == 0.0 and self.zero) or self.low <= size <= self.high

    def refusal(self, value: float | Sequence[float]) -> str | None:
        """Return why a value is implausible, with the expected range; None if it is plausible."""
        size = math.hypot(*value) if isinstance(value, Sequence) else abs(value)
        if self.holds(size):
            return None
        shown = f"a length of {size:.6g}" if isinstance(value, Sequence) else f"{value:.6g}"
        expected = f"expected is {self.low:g} to {self.high:g}"
        words = f"{shown} {self.unit} is implausible, {expected} {self.unit}".rstrip()
        return words.replace("  ", " ") + self.likely_unit(size)

    def likely_unit(self, size: float) -> str:
        """Name a unit in which a magnitude would be plausible, or its plausible inverse.

        Empty if neither fits.
        """
        for right in self.unit.split(" or "):
            for unit, factor in _OTHER_UNITS.get(right, {}).items():
                if self.holds(size * factor):
                    return f"; {size:.6g} {unit} would be {size * factor:.4g} {right}"
        if self.unit == "K" and self.holds(size + ZERO_CELSIUS_K):
            return f"; {size:.6g} °C would be {size + ZERO_CELSIUS_K:.6g} K"
        if not self.unit and size and self.holds(1.0 / size):
            return f"; its inverse would be {1.0 / size:.4g}"
        return ""


class Derived(ConfigModel):
    """Model with plausible ranges for values derived from several fields (radius of gyration)."""

    @abstractmethod
    def derived(self) -> dict[str, tuple[float, Plausible]]:
        """Return the derived values with their ranges, by name; a dot separates nested keys."""


def radius_of_gyration(
    mass_kg: float, moments_kg_m2: tuple[float, float, float]
) -> dict[str, tuple[float, Plausible]]:
    """Return a body's RMS radius of gyration about its centre [m], with its plausible range.

    Args:
        mass_kg: Mass [kg].
        moments_kg_m2: The three moments of inertia about the centre [kg m²].
    """
    radius_m = math.sqrt(max(sum(moments_kg_m2), 0.0) / (2.0 * mass_kg)) if mass_kg else 0.0
    return {"radius_of_gyration_m": (radius_m, Plausible(2e-3, 5.0, _GYRATION))}


class PhysicalFile(ConfigModel):
    """A file whose values have plausible ranges.

    Attributes:
        implausible_on_purpose: Keys whose values are correct although they are implausible.
    """

    implausible_on_purpose: tuple[str, ...] = ()

    @property
    def read_later(self) -> frozenset[str]:
        """The keys whose values are in another file that has not been read yet."""
        return frozenset()


Path = tuple[str | int, ...]


def implausible(file: object) -> Iterator[tuple[Path, str]]:
    """Yield the path and the reason of each implausible value of a loaded file.

    Only a `PhysicalFile` has `implausible_on_purpose`; another file, such as a drive's profile, has
    ranges too. A name in the list that is not a key, or whose value is plausible, is also reported.
    """
    file = file.root if isinstance(file, RootModel) else file
    if not isinstance(file, BaseModel):
        return
    on_purpose = file.implausible_on_purpose if isinstance(file, PhysicalFile) else ()
    read_later = file.read_later if isinstance(file, PhysicalFile) else frozenset()
    values = {
        key_name(path): (path, value, found) for path, value, found in _ranges(file, (), False)
    }
    refusals = {name: found.refusal(value) for name, (_, value, found) in values.items()}
    for number, name in enumerate(on_purpose):
        where = (ON_PURPOSE, number)
        if name in read_later:
            continue
        if name not in values:
            close = difflib.get_close_matches(name, values, n=1)
            yield (
                where,
                f"{name!r} is not a key with a plausible range; remove it"
                + (f", or did you mean {close[0]}?" if close else ""),
            )
        elif refusals[name] is None:
            yield where, f"{name} is plausible; remove it from this list"
    for name, refusal in refusals.items():
        if refusal is not None and name not in on_purpose:
            declared = (
                f"add {name} to {ON_PURPOSE}"
                if isinstance(file, PhysicalFile)
                else f"state it in the cell file, and its key there in {ON_PURPOSE}"
            )
            words = f"{refusal}. Correct it or, if it is intended, {declared}"
            yield values[name][0], words


def key_name(path: Path) -> str:
    """Return a key as written in messages and in `implausible_on_purpose`."""
    return ".".join(map(str, path))


def _ranges(value: object, path: Path, prismatic: bool) -> Iterator[tuple[Path, Any, Plausible]]:
    """Yield the path, value and range of every value in a model that has a range."""
    assert isinstance(value, BaseModel)
    prismatic = prismatic or getattr(value, "type", None) == "prismatic"
    if isinstance(value, Derived):
        for name, (size, found) in value.derived().items():
            parts = (int(part) if part.isdigit() else part for part in name.split("."))
            yield (*path, *parts), size, (found.prismatic if prismatic else None) or found
    for name, field in type(value).model_fields.items():
        inner = Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
        yield from _ranges_within(
            getattr(value, name), inner, (*path, field.alias or name), prismatic
        )


def _ranges_within(
    value: object, annotation: Any, path: Path, prismatic: bool
) -> Iterator[tuple[Path, Any, Plausible]]:
    """Yield the path, value and range of every part of a value that has a range."""
    if value is None:
        return
    if isinstance(value, BaseModel):
        yield from _ranges(value, path, prismatic)
        return
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is Annotated:
        for found in arguments[1:]:
            if isinstance(found, Plausible):
                yield path, value, (found.prismatic if prismatic else None) or found
        yield from _ranges_within(value, arguments[0], path, prismatic)
    elif origin in (typing.Union, types.UnionType):
        for argument in arguments:
            yield from _ranges_within(value, argument, path, prismatic)
    elif isinstance(value, tuple) and origin is tuple:
        inner = [arguments[0]] * len(value) if arguments[-1] is Ellipsis else arguments
        for number, (item, each) in enumerate(zip(value, inner, strict=True)):
            yield from _ranges_within(item, each, (*path, number), prismatic)
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from _ranges_within(item, arguments[1], (*path, key), prismatic)
