"""Allowed ranges of the numbers in requests, the same for every interface.

A request's field declares its range in its type. The bounds of the command-line option and the JSON
schema of the request come from that type. A request (`Ranged`) refuses a number that is out of
range or not finite when it is constructed.
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

CODE: Final = "RID-OPTION-RANGE"

Seed = Annotated[int, Field(ge=0, le=2**32 - 1)]
"""Seed of random numbers."""

Pace = Annotated[float, Field(ge=0.1, le=100.0)]
"""Speed of a simulated cell relative to real time."""

Periods = Annotated[int, Field(ge=2, le=100_000)]
"""Number of periods of a motion, without the warm-up."""

WarmUpPeriods = Annotated[int, Field(ge=3, le=100_000)]
"""Number of warm-up periods."""

Repeats = Annotated[int, Field(ge=1, le=20)]
"""Number of runs with a payload."""

PeriodS = Annotated[float, Field(ge=0.1, le=3600.0)]
"""Period of a motion [s]."""

Harmonics = Annotated[int, Field(ge=2, le=100)]
"""The highest harmonic of a motion."""

Starts = Annotated[int, Field(ge=1, le=100_000)]
"""Number of starting points of a search."""

Tries = Annotated[int, Field(ge=1, le=1_000_000)]
"""Number of random motions that are drawn and compared."""

LimitFraction = Annotated[float, Field(ge=0.01, le=1.0)]
"""Fraction of the limits that a motion may use."""

BudgetS = Annotated[float, Field(ge=1.0, le=604_800.0)]
"""Time limit of a search [s]."""

Realisations = Annotated[int, Field(ge=1, le=100)]
"""Number of realisations: multisines with one amplitude spectrum and different phases."""

FrequencyHz = Annotated[float, Field(ge=1e-4, le=1e4)]
"""A frequency [Hz]."""

CheckS = Annotated[float, Field(ge=0.1, le=600.0)]
"""Time during which a check counts answers [s]."""

WatchS = Annotated[float, Field(ge=0.1, le=3600.0)]
"""Time during which drives are read at rest [s]."""

JogPercent = Annotated[float, Field(ge=0.1, le=10.0)]
"""Speed of a jog, relative to each joint's limit [%]."""

PositionRad = Annotated[float, Field(ge=-100.0, le=100.0)]
"""Position of a joint [rad or m]."""

ReadingS = Annotated[float, Field(ge=1.0, le=600.0)]
"""Reading time of a force plate [s]."""

SettleS = Annotated[float, Field(ge=0.0, le=600.0)]
"""Time at rest before a force plate is read [s]."""

BufferS = Annotated[float, Field(ge=0.0, le=600.0)]
"""Length of a streamed path that is buffered [s]."""

PatienceS = Annotated[float, Field(ge=0.0, le=86_400.0)]
"""Longest time to wait for the first points of a stream [s]."""

Confidence = Annotated[float, Field(ge=0.0, le=0.999_999)]
"""A probability; 0 for no margin."""

FreeShare = Annotated[float, Field(ge=0.0, le=0.99)]
"""Fraction of a limit that is kept as a reserve."""

Rate = Annotated[float, Field(ge=1e-6, le=1e9)]
"""Additional limit of a timed path: RMS torque [N m], torque rate [N m/s] or jerk [rad/s³]."""

TolerancePercent = Annotated[float, Field(ge=0.0, le=100.0)]
"""Largest allowed difference [%]."""

SmoothingRadS = Annotated[float, Field(ge=0.0, le=10.0)]
"""Speed range over which a sign function is smoothed [rad/s or m/s]."""

Coefficient = Annotated[float, Field(ge=-1e9, le=1e9)]
"""Friction parameter, in its own unit."""

KnownValue = Annotated[float, Field(ge=-1e4, le=1e4)]
"""Quantity of a payload that is known from another measurement [kg, m or kg m²]."""

KnownSigma = Annotated[float, Field(ge=0.0, le=1e4)]
"""Standard deviation of a `KnownValue`."""


@dataclass(frozen=True)
class Ranged:
    """Dataclass that refuses numbers outside the ranges of its fields.

    Fields that are themselves `Ranged` check their own numbers.

    Raises:
        ConfigError: A number is outside its field's range or is not finite (NaN, infinity).
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid", allow_inf_nan=False)

    def __post_init__(self) -> None:
        names = [field.name for field in dataclasses.fields(self)]
        for path, value, limits in numbers_of(self, names, type(self)):
            text = refusal(value, limits)
            if text is not None:
                raise ConfigError(f"{key_name(path)}: {text}", code=CODE)


def upper_bound(annotated: Any) -> Any:
    """Return the upper bound of a type with a range."""
    return next(found for found in _bounds(annotated.__metadata__, "le"))


def _bounds(limits: Sequence[object], side: str) -> Iterator[float]:
    for limit in limits:
        if isinstance(limit, FieldInfo):
            yield from (getattr(each, side) for each in limit.metadata if hasattr(each, side))


def refusal(value: float, limits: Sequence[object]) -> str | None:
    """Return why a value is refused; None if it is accepted.

    Args:
        limits: The annotations of its type: bounds and a plausible range.
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
    """Yield the path, the value and the type annotations of each number in an object's fields.

    Args:
        kind: The class that declares the fields.
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
