"""`interval`: format a value and its uncertainty with the significant digits only."""

from __future__ import annotations

import math

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PLAIN = (-5, 6)  # between these powers of ten, a value is written without an exponent


def interval(value: float, reach: float) -> tuple[str, str]:
    """Return a value and its half-width as texts; the half-width has two significant digits.

    Both texts end at the same decimal place.

    Args:
        value, reach: A finite value, and the half-width of its interval, finite and above 0.

    Returns:
        Text such as 9.61 and 0.12, or 1230 and 340.
    """
    last = math.floor(math.log10(float(f"{reach:.1e}"))) - 1  # power of ten of the last digit
    power = math.floor(math.log10(max(abs(value), reach)))
    power = 0 if _PLAIN[0] < power < _PLAIN[1] else power
    decimals = max(power - last, 0)
    tail = f"·10{superscript(power)}" if power else ""
    texts = [f"{round(each, -last) / 10.0**power:.{decimals}f}" for each in (value, reach)]
    shown, around = (with_minus_sign(f"{text}{tail}") for text in texts)
    nothing = f"{0.0:.{decimals}f}{tail}"
    return (nothing if shown == with_minus_sign(f"-{nothing}") else shown), around


def with_minus_sign(text: str) -> str:
    """Return a number's text with the typographic minus sign."""
    return text.replace("-", "\N{MINUS SIGN}")


def superscript(power: int) -> str:
    """Return an exponent in superscript digits."""
    return str(power).translate(_SUPERSCRIPT)


def plus_minus(value: float, reach: float, unit: str) -> str:
    """Return a value with its interval as one text, such as 9.61 ± 0.12 kg."""
    if not (math.isfinite(value) and math.isfinite(reach) and reach > 0.0):
        return f"{value:.6g} ± {reach:.2g} {unit}".rstrip()
    return f"{' ± '.join(interval(value, reach))} {unit}".rstrip()
