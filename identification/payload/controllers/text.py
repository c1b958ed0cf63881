"""Words and numbers of load data: how they are written, and found again."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Final

import numpy as np

from config.arrays import FloatArray

NUMBER: Final = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
"""What a number looks like in a text."""


SMALLEST: Final = 1e-15
"""What is written as 0: what a computer leaves of a sum that is none."""

Digits = Callable[[float], str]
"""How the numbers of a text are written."""


def significant(count: int) -> Digits:
    """Return what writes a number with so many significant digits, never as minus zero."""

    def digits(value: float) -> str:
        text = f"{float(value):.{count}g}"
        if "e" in text and 1e-9 < abs(value) < 1e9:  # no pendant has an exponent
            decimals = max(count - 1 - math.floor(math.log10(abs(value))), 0)
            text = f"{float(text):.{decimals}f}"
            text = text.rstrip("0").rstrip(".") if "." in text else text
        return "0" if abs(float(text)) < SMALLEST else text

    return digits


def comments(mark: str, lines: tuple[str, ...]) -> str:
    """Return lines as comments behind a mark."""
    return "".join(f"{mark} {line}\n" for line in lines)


def found(pattern: str, text: str, what: str) -> re.Match[str]:
    """Return where a pattern is in a text; ValueError where it is not."""
    match = re.search(pattern, text)
    if match is None:
        raise ValueError(f"no {what} in it")
    return match


def match_numbers(match: re.Match[str]) -> FloatArray:
    """Return the groups of a match as numbers."""
    return np.array([float(group) for group in match.groups()])
