"""Words and numbers of load data: how they are written, and found again."""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from config.arrays import FloatArray

NUMBER: Final = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
"""What a number looks like in a text."""


def digits(value: float) -> str:
    """Write a number so that it reads back to ten digits, never as minus zero."""
    text = f"{float(value):.12g}"
    return "0" if text == "-0" else text


def comments(mark: str, lines: tuple[str, ...]) -> str:
    """Return lines as comments behind a mark."""
    return "".join(f"{mark} {line}\n" for line in lines)


def found(pattern: str, text: str, what: str) -> re.Match[str]:
    """Return where a pattern is in a text; ValueError where it is not."""
    match = re.search(pattern, text)
    if match is None:
        raise ValueError(f"no {what} in it")
    return match


def numbers(match: re.Match[str]) -> FloatArray:
    """Return the groups of a match as numbers."""
    return np.array([float(group) for group in match.groups()])
