"""`parse_number`: strict conversion of decimal text to a number; `number_hint`: why it fails.

Python's own `float` reads `1_5` as 15, and accepts `nan` and `infinity`. Such a text in a file is a
mistake. Therefore it is an error, and no default is used.
"""

from __future__ import annotations

import math
import re
from typing import Final

from config.errors import ConfigError

NUMBER_CODE: Final = "RID-FILE-NUMBER"

DECIMAL_COMMA: Final = re.compile(r"[-+]?[0-9]*,[0-9]+([eE][-+]?[0-9]+)?")
"""A number with a decimal comma."""

_NUMBER: Final = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_GROUPED: Final = re.compile(r"[-+]?[0-9.,]*[0-9][_' ][0-9][0-9_'., ]*")
_INFINITE: Final = re.compile(r"[-+]?inf(inity)?", re.IGNORECASE)
_NOT_FINITE: Final = re.compile(r"[-+]?(nan|inf(inity)?)", re.IGNORECASE)
_WITH_UNIT: Final = re.compile(rf"({_NUMBER.pattern})\s*[^\d\s.,_+*/-][^\d]*")
_EXPRESSION: Final = re.compile(r"\$[({]")


def parse_number(text: str) -> float:
    """Return the finite number that a text states in plain decimal digits.

    Raises:
        ConfigError: The text is anything else; the message states the text and, if the cause is
            known, what to write.
    """
    words = text.strip()
    if _NUMBER.fullmatch(words):
        number = float(words)
        if math.isfinite(number):
            return number
    raise ConfigError(f"{text!r} is not a number{number_hint(words)}", code=NUMBER_CODE)


def parse_numbers(text: str) -> tuple[float, ...]:
    """Return the finite numbers of a comma-separated text.

    Raises:
        ConfigError: A part is not a finite number.
    """
    return tuple(parse_number(word) for word in text.split(","))


def is_infinite(text: str) -> bool:
    """Return True if a text means infinity, as files write it for "no limit"."""
    return _INFINITE.fullmatch(text.strip()) is not None


def is_not_finite(text: str) -> bool:
    """Return True if a text means infinity or nan."""
    return _NOT_FINITE.fullmatch(text.strip()) is not None


def number_hint(text: str) -> str:
    """Return a hint about a text that is not a number; empty if the cause is unknown."""
    if _EXPRESSION.search(text):
        return ": an expression that xacro has not expanded; run xacro FILE > robot.urdf first"
    if any(DECIMAL_COMMA.fullmatch(word) for word in text.split()):
        return f": a decimal comma; write {text.replace(',', '.')}"
    if any(_NOT_FINITE.fullmatch(word) for word in text.split()):
        return ": give a finite number"
    if not text:
        return ": it is empty; give a number"
    if _GROUPED.fullmatch(text):
        return ": write plain digits with a decimal point, without separators"
    if _WITH_UNIT.fullmatch(text):
        return ": write the number without a unit, in SI units"
    if _NUMBER.fullmatch(text):
        if math.isfinite(float(text)):
            return ": it is text; remove the quotes"
        return ": it is too large; give a smaller number"
    return ""
