"""`PlateMistake`: a mistake in the description of a force plate, and its correction."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from pydantic import Strict

from config.model import ConfigModel


class PlateKind(StrEnum):
    """Kind of a mistake."""

    SIZE = "plate size"
    POSITION = "plate position"
    ROTATION = "plate rotation"
    SENSITIVITY = "channel sensitivity"
    ORDER = "order of channels"


class PlateMistake(ConfigModel):
    """A probable mistake in the plate's description.

    Attributes:
        kind: Kind of the mistake.
        key: The wrong key of `plate` in the cell file or the import map.
        stated: Value in this file; for sensitivities a 1 for each affected channel, for an
            order the channels' numbers.
        right: Value that explains the measurement; for sensitivities the factors by which the
            readings of these channels must be multiplied, for an order the channels' numbers.
        times_better: Largest factor by which the correction reduces the residual of a component of
            the wrench; 1 if only the arm's weight reveals the mistake.
        sentence: The finding in words.
    """

    kind: PlateKind
    key: str
    stated: Annotated[tuple[float, ...], Strict(False)]
    right: Annotated[tuple[float, ...], Strict(False)]
    times_better: float
    sentence: str
