"""The ranges of numbers that a person or a program may ask for: the same at every entrance.

A request's field says its range in its type. The bounds of the command's option come from that type
(`least`, `most`), requests' JSON schemas show it, and a request that is made with another value, or
with one that is no number, is refused by itself (`Ranged`): it cannot be had, wherever it is made.
"""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Final

from pydantic import ConfigDict, Field
from pydantic.fields import FieldInfo

from config.errors import ConfigError
from config.plausible import Path, Plausible, key_name

CODE: Final = "RID-REQ-RANGE"

Seed = Annotated[int, Field(ge=0, le=2**32 - 1)]
"""What is drawn by chance comes from it."""

Pace = Annotated[float, Field(ge=0.1, le=100.0)]
"""Times real time at which a simulated cell runs."""

Periods = Annotated[int, Field(ge=2, le=100_000)]
"""Periods of a motion that count."""

WarmUpPeriods = Annotated[int, Field(ge=3, le=100_000)]
"""Periods of a warm-up."""

Repeats = Annotated[int, Field(ge=1, le=20)]
"""Runs with a payload."""

PeriodS = Annotated[float, Field(ge=0.1, le=3600.0)]
"""A period of a motion [s]."""

Harmonics = Annotated[int, Field(ge=2, le=100)]
"""The highest harmonic of a motion."""

Starts = Annotated[int, Field(ge=1, le=100_000)]
"""Starts of a search."""

Tries = Annotated[int, Field(ge=1, le=1_000_000)]
"""Motions that are drawn and compared."""

LimitFraction = Annotated[float, Field(ge=0.01, le=1.0)]
"""A share of the limits that a motion may use."""

BudgetS = Annotated[float, Field(ge=1.0, le=604_800.0)]
"""The time that a search may take [s]."""

Realisations = Annotated[int, Field(ge=1, le=100)]
"""Multisines of one spectrum."""

FrequencyHz = Annotated[float, Field(ge=1e-4, le=1e4)]
"""A frequency [Hz]."""

CheckS = Annotated[float, Field(ge=0.1, le=600.0)]
"""How long a check counts answers [s]."""

JogPercent = Annotated[float, Field(ge=0.1, le=10.0)]
"""Speed of a jog, of each joint's limit [%]."""

PositionRad = Annotated[float, Field(ge=-100.0, le=100.0)]
"""A joint's position [rad or m]."""

ReadingS = Annotated[float, Field(ge=1.0, le=600.0)]
"""How long a force plate is read [s]."""

SettleS = Annotated[float, Field(ge=0.0, le=600.0)]
"""Rest before a force plate is read [s]."""

BufferS = Annotated[float, Field(ge=0.0, le=600.0)]
"""How much of a streamed path is taken in ahead [s]."""

PatienceS = Annotated[float, Field(ge=0.0, le=86_400.0)]
"""How long points are waited for [s]."""

Confidence = Annotated[float, Field(ge=0.0, le=0.999_999)]
"""A probability; 0 for no margin."""

FreeShare = Annotated[float, Field(ge=0.0, le=0.99)]
"""A share of a limit that is kept free."""

Rate = Annotated[float, Field(ge=1e-6, le=1e9)]
"""A further limit of a path: of torque [N m], its rate [N m/s], or jerk [rad/s³]."""

TolerancePercent = Annotated[float, Field(ge=0.0, le=100.0)]
"""A largest difference [%]."""

SmoothingRadS = Annotated[float, Field(ge=0.0, le=10.0)]
"""Speed over which a sign changes [rad/s or m/s]."""

Coefficient = Annotated[float, Field(ge=-1e9, le=1e9)]
"""A parameter of friction, in its own unit."""

KnownValue = Annotated[float, Field(ge=-1e4, le=1e4)]
"""A quantity of a payload that was measured otherwise [kg, m or kg m²]."""

KnownSigma = Annotated[float, Field(ge=0.0, le=1e4)]
"""Its standard deviation."""


@dataclass(frozen=True)
class Ranged:
    """A dataclass that refuses numbers outside the ranges of its fields.

    Fields that are dataclasses look at their own numbers.

    Raises:
        ConfigError: A number is outside of its field's range, or is none (NaN, infinity).
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid", allow_inf_nan=False)

    def __post_init__(self) -> None:
        names = [field.name for field in dataclasses.fields(self)]
        for path, value, limits in numbers_of(self, names, type(self)):
            text = refusal(value, limits)
            if text is not None:
                raise ConfigError(f"{key_name(path)}: {text}", code=CODE)


def least(annotated: Any) -> Any:
    """Return the lower bound of a type with a range, as `typer.Option` takes it."""
    return next(found for found in _bounds(annotated.__metadata__, "ge"))


def most(annotated: Any) -> Any:
    """Return the upper bound of a type with a range, as `typer.Option` takes it."""
    return next(found for found in _bounds(annotated.__metadata__, "le"))


def _bounds(limits: Sequence[object], side: str) -> Iterator[float]:
    for limit in limits:
        if isinstance(limit, FieldInfo):
            yield from (getattr(each, side) for each in limit.metadata if hasattr(each, side))


def refusal(value: float, limits: Sequence[object]) -> str | None:
    """Return why a value is refused, None if it is not.

    Args:
        limits: The annotations of its type: bounds, and a plausible range.
    """
    if not math.isfinite(value):
        return f"{value:g} is not a finite number: give a number"
    low = max(_bounds(limits, "ge"), default=-math.inf)
    high = min(_bounds(limits, "le"), default=math.inf)
    if not low <= value <= high:
        return f"{value:g} is outside its range: give {low:g} to {high:g}"
    plausible = (limit.refusal(value) for limit in limits if isinstance(limit, Plausible))
    return next((found for found in plausible if found is not None), None)


_HINTS: dict[type, dict[str, Any]] = {}


def numbers_of(
    request: object, names: Iterable[str], kind: type
) -> Iterator[tuple[Path, float, Sequence[object]]]:
    """Yield the numbers in fields of an object, their paths, and the annotations of their types.

    Args:
        request: The object.
        names: Names of the fields.
        kind: The class that declares them.
    """
    if kind not in _HINTS:
        _HINTS[kind] = typing.get_type_hints(kind, include_extras=True)
    for name in names:
        yield from _numbers(getattr(request, name), _HINTS[kind][name], (name,), ())


def _numbers(
    value: object, annotation: Any, path: Path, limits: tuple[object, ...]
) -> Iterator[tuple[Path, float, Sequence[object]]]:
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is Annotated:
        yield from _numbers(value, arguments[0], path, (*limits, *arguments[1:]))
    elif origin in (typing.Union, types.UnionType):
        for argument in arguments:
            yield from _numbers(value, argument, path, limits)
    elif isinstance(value, (tuple, list)) and arguments:
        fixed = origin is tuple and arguments[-1] is not Ellipsis
        for number, item in enumerate(value):
            inner = arguments[number % len(arguments)] if fixed else arguments[0]
            yield from _numbers(item, inner, (*path, number), limits)
    elif annotation in (int, float) and type(value) is not bool and isinstance(value, (int, float)):
        yield path, value, limits
