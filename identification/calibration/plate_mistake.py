"""`PlateMistake`: what is wrong in the description of a force plate, and what is right."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from pydantic import Strict

from config.model import ConfigModel


class PlateKind(StrEnum):
    """What kind of mistake it is."""

    SIZE = "plate size"
    POSITION = "plate position"
    ROTATION = "plate rotation"
    SENSITIVITY = "channel sensitivity"
    ORDER = "order of channels"


class PlateMistake(ConfigModel):
    """What is probably wrong in the plate's description.

    Attributes:
        kind: What is wrong.
        key: The key of the cell file's `plate` that states it.
        stated, right: Its value, and the value that explains the plate; of sensitivities the
            factors, of an order the channels' numbers.
        times_better: By which factor the residual falls where it falls most; 1 if the arm's weight
            tells the mistake and no residual does.
        sentence: The finding in words.
    """

    kind: PlateKind
    key: str
    stated: Annotated[tuple[float, ...], Strict(False)]
    right: Annotated[tuple[float, ...], Strict(False)]
    times_better: float
    sentence: str
