"""`plausible`: a command's number in the unit that its help says, refused where it is implausible.

It is the callback of an option: what a file's key says by `Annotated[float, Plausible(...)]`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import typer

from config.errors import ConfigError
from config.plausible import Plausible

Callback = Callable[[typer.CallbackParam, float | None], float | None]


def plausible(low: float, high: float, unit: str) -> Callback:
    """Return the callback of an option whose size lies from `low` to `high`; zero is no size.

    It raises a ConfigError that names the option, the unit, and the one that was probably meant.
    """
    found = Plausible(low, high, unit)

    def look(param: typer.CallbackParam, value: float | None) -> float | None:
        refusal = None if value is None else found.refusal(value)
        if refusal is not None:
            raise ConfigError(f"{param.opts[0]}: {refusal}")
        return value

    return look


BAND: Final = plausible(0.1, 1e3, "Hz")
STANDSTILL: Final = plausible(1e-4, 1.0, "rad/s")
SHARE: Final = plausible(0.1, 1e3, "%")
MILLIMETRES: Final = plausible(0.05, 500.0, "mm")
