"""Numbers, durations, units and times in readable form, for pages and the console."""

from __future__ import annotations

import math

from config.formats.interval import interval, superscript, with_minus_sign


def number(value: float | int | None, digits: int = 4) -> str:
    """Return a number with `digits` significant digits; words or a dash if there is no number.

    Args:
        value: The number.
        digits: Significant digits of a float; an integer is written completely.

    Returns:
        For example 1.235, or 1.5·10⁻⁷.
    """
    if value is None:
        return "–"
    if isinstance(value, int):
        return str(value)
    if not math.isfinite(value):
        return "not finite"
    text = f"{value:.{digits}g}"
    if "e+" in text and abs(value) < 1e6:
        text = f"{float(text):.0f}"
    elif "e" in text:
        mantissa, exponent = text.split("e")
        return with_minus_sign(f"{mantissa}·10{superscript(int(exponent))}")
    return with_minus_sign(text)


def format_measured(value: float | None, reach: float | None) -> tuple[str, str]:
    """Return a value and its interval as texts, both rounded to the same decimal place.

    Args:
        value, reach: The value, and the half width of its interval, which gets two significant
            digits.

    Returns:
        For example 9.61 and 0.12, or 1230 and 340; without an interval the value as in `number`.
    """
    if value is None or reach is None or not math.isfinite(value):
        return number(value), number(reach, 2)
    if not math.isfinite(reach) or reach <= 0.0:
        return number(value, 6), number(reach, 2)
    return interval(value, reach)


def duration(seconds: float) -> str:
    """Return a duration [s] in seconds, or in minutes and seconds."""
    if seconds < 120.0:
        return f"{seconds:.1f} s"
    return f"{int(seconds // 60)} min {seconds % 60:.0f} s"


def unit(text: str) -> str:
    """Return a unit with superscript exponents."""
    return text.replace("^2", "²").replace("^3", "³")


def format_utc(stamp: str) -> str:
    """Return an ISO 8601 time stamp in UTC, to the minute, in readable form."""
    return f"{stamp[:16].replace('T', ' ')} UTC"
