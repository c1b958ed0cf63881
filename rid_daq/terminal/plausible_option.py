"""`plausible`: a command's number in the unit that its help says, refused where it is implausible.

It is the callback of an option. What becomes a field of a request that services take has its range
in the field's type, `Annotated[float, Plausible(...)]`: `plausible_as` takes it from there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import typer

from config.errors import ConfigError
from config.plausible import Plausible, range_of

Callback = Callable[[typer.CallbackParam, float | None], float | None]


def plausible_as(annotated: Any, *, percent: bool = False) -> Callback:
    """Return the same by the type of a request's field; in percent of what is a share there."""
    found = range_of(annotated)
    return _looking(found.in_percent if percent else found)


def _looking(found: Plausible) -> Callback:

    def look(param: typer.CallbackParam, value: float | None) -> float | None:
        refusal = None if value is None else found.refusal(value)
        if refusal is not None:
            raise ConfigError(f"{param.opts[0]}: {refusal}", code="RID-OPTION-RANGE")
        return value

    return look
