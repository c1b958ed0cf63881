"""Numbers, durations, units and times as people write them, on pages and on the console."""

from __future__ import annotations

import math

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: float | int | None, digits: int = 4) -> str:
    """Return a number for people: `digits` significant digits, a dash where there is none.

    Parameters
    ----------
    value : float, int or None
        The number.
    digits : int
        Significant digits of a float; an integer is written whole.

    Returns
    -------
    str
        Such as 1.235, or 1.5·10⁻⁷.
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
        power = str(int(exponent)).translate(_SUPERSCRIPT)
        return f"{mantissa}·10{power}".replace("-", "\N{MINUS SIGN}")
    return text.replace("-", "\N{MINUS SIGN}")


def duration(seconds: float) -> str:
    """Return a duration [s] as people say it."""
    if seconds < 120.0:
        return f"{seconds:.1f} s"
    return f"{int(seconds // 60)} min {seconds % 60:.0f} s"


def unit(text: str) -> str:
    """Return a unit with its powers raised."""
    return text.replace("^2", "²").replace("^3", "³")


def moment(stamp: str) -> str:
    """Return an ISO 8601 time stamp of UTC to the minute, as people write it."""
    return f"{stamp[:16].replace('T', ' ')} UTC"
