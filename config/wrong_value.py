"""`explain_error`: a validator's error as text: the value, and what to write instead."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

BOUNDS: Final[Mapping[str, tuple[str, str]]] = {
    "greater_than": ("gt", "more than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}
"""Key of the bound in the context of each type of error, and the bound in words."""

_KEYS: Final = "keys and values, such as `key: value`"
_NAMES: Final = "names and values, such as `name: value`"
_LIST: Final = "a list, such as [1, 2, 3]"
_EXPECTED: Final[Mapping[str, str]] = {
    **dict.fromkeys(("float_type", "float_parsing"), "a number"),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "a whole number"),
    **dict.fromkeys(("bool_type", "bool_parsing"), "true or false"),
    **dict.fromkeys(("model_type", "model_attributes_type", "dataclass_type"), _KEYS),
    "dict_type": _NAMES,
    **dict.fromkeys(("list_type", "tuple_type", "set_type", "frozen_set_type"), _LIST),
    "string_type": "a text; put a number that is a text in quotes",
    "finite_number": "a finite number",
}
_LENGTHS: Final[Mapping[str, tuple[str, str]]] = {
    "too_short": ("min_length", "at least"),
    "too_long": ("max_length", "at most"),
    "string_too_short": ("min_length", "at least"),
    "string_too_long": ("max_length", "at most"),
}
_NUMBERS: Final = ("float_type", "float_parsing", "int_type", "int_parsing", "finite_number")
_LONGEST: Final = 60
"""Number of characters of a value that a message shows."""


def explain_error(error: ErrorDetails, hint: str = "") -> str:
    """Return what is wrong with a value and what to write, without file and key.

    Args:
        error: The error.
        hint: Reason for which a text is not a number, if it is known.
    """
    kind, given, context = error["type"], error.get("input"), error.get("ctx", {})
    if kind == "missing":
        name = error["loc"][-1] if error["loc"] else ""
        if isinstance(name, int):
            return f"the list is too short: value {name + 1} is missing"
        return f"the key {name!r} is missing"
    if kind == "extra_forbidden":
        return "unknown key: remove it"
    if kind in BOUNDS:
        key, words = BOUNDS[kind]
        return f"{given} is outside its range: give {words} {context[key]:g}"
    if kind in _LENGTHS:
        key, words = _LENGTHS[kind]
        length = len(given) if isinstance(given, str | list | dict | tuple) else None
        what = "characters" if isinstance(given, str) else "values"
        has = f"has {context.get('actual_length', length)} {what}"
        return f"{has}: give {words} {context[key]}"
    if kind in ("literal_error", "enum"):
        return _explain_choice(given, str(context["expected"]))
    if kind in _EXPECTED:
        if isinstance(given, str) and kind in _NUMBERS:
            return f"{_shown(given)} is not a number{hint or f': give {_EXPECTED[kind]}'}"
        return f"{_named(given)}: give {_EXPECTED[kind]}"
    message = error["msg"].removeprefix("Value error, ").replace("Input should", "must")
    return message if kind == "value_error" else f"{_shown(given)}: {message}"


def _explain_choice(given: Any, expected: str) -> str:
    """Explain that a value is not one of the choices, which the validator writes in one text."""
    choices = re.findall(r"'([^']*)'", expected)
    close = difflib.get_close_matches(given, choices, n=1) if isinstance(given, str) else []
    meant = f"; did you mean {close[0]}?" if close else ""
    if isinstance(given, str | int | float):
        return f"{_shown(given)} is not allowed: give {expected}{meant}"
    return f"{_named(given)}: give {expected}"


def _named(given: Any) -> str:
    """Return a value with its type, as users name it."""
    if given is None:
        return "the value is missing"
    if isinstance(given, dict):
        return "keys are not expected here"
    if isinstance(given, list | tuple):
        return "a list is not expected here"
    if isinstance(given, bool):
        return f"{_shown(given)} is not expected here"
    if isinstance(given, float) and not math.isfinite(given):
        return f"{given} is not a finite number"
    kind = "a text" if isinstance(given, str) else "a number"
    return f"{_shown(given)} is {kind}"


def _shown(given: Any) -> str:
    """Return a value as a file contains it, shortened."""
    if isinstance(given, bool):
        return "true" if given else "false"
    if isinstance(given, dict | list | tuple):
        return "the value"
    text = repr(given)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"
