"""Functions that write and find the numbers of load data."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Final

import numpy as np

from config.arrays import FloatArray

NUMBER: Final = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
"""Regular expression of a number."""


SMALLEST: Final = 1e-15
"""Magnitude below which a number is written as 0: rounding error of a sum."""

Digits = Callable[[float], str]
"""Function that returns a number as text."""


def number_writer(count: int) -> Digits:
    """Return a function that writes numbers with `count` significant digits, never minus zero."""

    def digits(value: float) -> str:
        text = f"{float(value):.{count}g}"
        if "e" in text and 1e-9 < abs(value) < 1e9:  # no teach pendant shows an exponent
            decimals = max(count - 1 - math.floor(math.log10(abs(value))), 0)
            text = f"{float(text):.{decimals}f}"
            text = text.rstrip("0").rstrip(".") if "." in text else text
        return "0" if abs(float(text)) < SMALLEST else text

    return digits


def comments(mark: str, lines: tuple[str, ...]) -> str:
    """Return lines as comments; each begins with the comment mark."""
    return "".join(f"{mark} {line}\n" for line in lines)


def find_match(pattern: str, text: str, what: str) -> re.Match[str]:
    """Return the first match of a pattern in a text; raise ValueError if there is no match."""
    match = re.search(pattern, text)
    if match is None:
        raise ValueError(f"the text contains no {what}")
    return match


def match_numbers(match: re.Match[str]) -> FloatArray:
    """Return the groups of a match as numbers."""
    return np.array([float(group) for group in match.groups()])
