"""`interval`: a value and how far it may be off, with the digits that people can rely on."""

from __future__ import annotations

import math

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PLAIN = (-5, 6)  # powers of ten that are written without one


def interval(value: float, reach: float) -> tuple[str, str]:
    """Return a value and its interval: the interval to two significant digits, both to the same.

    Args:
        value, reach: A finite value, and how far its interval reaches to either side; above 0 and
            finite.

    Returns:
        Such as 9.61 and 0.12, or 1230 and 340.
    """
    last = math.floor(math.log10(float(f"{reach:.1e}"))) - 1  # the place of the last digit
    power = math.floor(math.log10(max(abs(value), reach)))
    power = 0 if _PLAIN[0] < power < _PLAIN[1] else power
    decimals = max(power - last, 0)
    tail = f"·10{raised(power)}" if power else ""
    texts = [f"{round(each, -last) / 10.0**power:.{decimals}f}" for each in (value, reach)]
    shown, around = (minus(f"{text}{tail}") for text in texts)
    nothing = f"{0.0:.{decimals}f}{tail}"
    return (nothing if shown == minus(f"-{nothing}") else shown), around


def minus(text: str) -> str:
    """Return a number's text with the sign that print has."""
    return text.replace("-", "\N{MINUS SIGN}")


def raised(power: int) -> str:
    """Return a power as it stands above the line."""
    return str(power).translate(_SUPERSCRIPT)


def plus_minus(value: float, reach: float, unit: str) -> str:
    """Return a value with its interval in one text, as 9.61 ± 0.12 kg."""
    if not (math.isfinite(value) and math.isfinite(reach) and reach > 0.0):
        return f"{value:.6g} ± {reach:.2g} {unit}".rstrip()
    return f"{' ± '.join(interval(value, reach))} {unit}".rstrip()
