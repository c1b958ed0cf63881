"""`parse_number`: decimal text to a number, strictly; and `number_hint`, why a text is none.

Python's own `float` reads `1_5` as 15, `nan` and `infinity`. A file that holds such a text means
something else, and no default may take its place.
"""

from __future__ import annotations

import math
import re
from typing import Final

from config.errors import ConfigError

NUMBER_CODE: Final = "RID-FILE-NUMBER"

_NUMBER: Final = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_COMMA: Final = re.compile(r"[-+]?[0-9]*,[0-9]+([eE][-+]?[0-9]+)?")
_GROUPED: Final = re.compile(r"[-+]?[0-9.,]*[0-9][_' ][0-9][0-9_'., ]*")
_INFINITE: Final = re.compile(r"[-+]?inf(inity)?", re.IGNORECASE)
_NOT_FINITE: Final = re.compile(r"[-+]?(nan|inf(inity)?)", re.IGNORECASE)
_WITH_UNIT: Final = re.compile(rf"({_NUMBER.pattern})\s*[^\d\s.,_+*/-][^\d]*")
_EXPRESSION: Final = re.compile(r"\$[({]")


def parse_number(text: str) -> float:
    """Return the finite number that a text holds in plain decimal digits.

    Raises:
        ConfigError: The text is anything else; it says what, and what to write.
    """
    words = text.strip()
    if _NUMBER.fullmatch(words):
        number = float(words)
        if math.isfinite(number):
            return number
    raise ConfigError(f"{text!r} is not a number{number_hint(words)}", code=NUMBER_CODE)


def parse_numbers(text: str) -> tuple[float, ...]:
    """Return the finite numbers of a text with commas between them.

    Raises:
        ConfigError: One of them is none.
    """
    return tuple(parse_number(word) for word in text.split(","))


def is_infinite(text: str) -> bool:
    """Return True if a text says infinity, as limits do that are none."""
    return _INFINITE.fullmatch(text.strip()) is not None


def is_not_finite(text: str) -> bool:
    """Return True if a text says infinity or nan."""
    return _NOT_FINITE.fullmatch(text.strip()) is not None


def number_hint(text: str) -> str:
    """Return what a text that is no number seems to be; empty if it resembles none."""
    if _EXPRESSION.search(text):
        return ": an expression that xacro has not expanded; run xacro FILE > robot.urdf first"
    if any(_COMMA.fullmatch(word) for word in text.split()):
        return f": a decimal comma; write {text.replace(',', '.')}"
    if any(_NOT_FINITE.fullmatch(word) for word in text.split()):
        return ": only finite numbers are read"
    if not text:
        return ": it is empty"
    if _GROUPED.fullmatch(text):
        return ": write plain digits with a decimal point, without separators"
    if _WITH_UNIT.fullmatch(text):
        return ": write the number without a unit, in SI units"
    if _NUMBER.fullmatch(text):
        return ": it is too large"
    return ""
