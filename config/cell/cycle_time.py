"""`CycleTimeMs`: cycle times in whole microseconds, and their coding in a drive's object 60C2h."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import AfterValidator, Field, PlainSerializer

_LARGEST: Final = 255
_POWERS: Final = (-3, -4, -5, -6)
_ROUNDING: Final = 1e-6


def as_milliseconds(period_s: float) -> float:
    """Return a period [ms], rounded to microseconds; an `int` if it is whole milliseconds."""
    return _plain(round(1e3 * period_s, 3))


def _plain(value: float) -> float:
    return int(value) if float(value).is_integer() else value


def _in_microseconds(value: float) -> float:
    """Return a cycle time [ms]; refuse parts of a microsecond.

    Raises:
        ValueError: The cycle time is not a whole number of microseconds.
    """
    if abs(1e3 * value - round(1e3 * value)) > _ROUNDING:
        raise ValueError(
            f"{value!r} ms is not a whole number of microseconds: use {round(value, 3):g} ms"
        )
    return _plain(value)


CycleTimeMs = Annotated[
    float,
    Field(ge=1, le=100),
    AfterValidator(_in_microseconds),
    PlainSerializer(_plain, return_type=int | float),
]
"""A cycle time [ms] in whole microseconds; whole milliseconds are an `int`."""


def interpolation_period(cycle_time_ms: float) -> tuple[int, int] | None:
    """Return mantissa and power of ten [s] of a cycle time, as in 60C2h (CiA 402).

    The mantissa has eight bits. Milliseconds are preferred, because every drive supports them.

    Args:
        cycle_time_ms: The cycle time [ms].

    Returns:
        `mantissa, power`, or None if no mantissa represents the cycle time.
    """
    for power in _POWERS:
        mantissa = cycle_time_ms * 10.0 ** (-3 - power)
        if abs(mantissa - round(mantissa)) <= _ROUNDING and round(mantissa) <= _LARGEST:
            return round(mantissa), power
    return None


def nearest_periods(cycle_time_ms: float) -> tuple[float, float]:
    """Return the next shorter and longer cycle time [ms] that 60C2h represents.

    Args:
        cycle_time_ms: A cycle time [ms] that no mantissa represents, from 1 to 100.
    """
    shorter, longer = [], []
    for power in _POWERS:
        step_ms = 10.0 ** (3 + power)
        mantissa = int(cycle_time_ms / step_ms)
        shorter.append(min(mantissa, _LARGEST) * step_ms)
        if mantissa < _LARGEST:
            longer.append((mantissa + 1) * step_ms)
    return _plain(round(max(shorter), 3)), _plain(round(min(longer), 3))
