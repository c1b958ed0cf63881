"""`PlateMistake`: what is wrong in the description of a force plate, and what is right."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class PlateKind(StrEnum):
    """What kind of mistake it is."""

    SIZE = "plate size"
    POSITION = "plate position"
    ROTATION = "plate rotation"
    SENSITIVITY = "channel sensitivity"
    ORDER = "order of channels"


@dataclass(frozen=True)
class PlateMistake:
    """A mistake in a plate's description.

    Attributes
    ----------
    kind : PlateKind
        What is wrong.
    key : str
        The key of the cell file's `plate` that states it.
    stated, right : tuple of float
        Its value, and the value that explains the plate; of a sensitivity the factor, of an order
        the channels' numbers.
    words : str
        What is wrong, in words.
    times_better : float
        By which factor the residual of the wrench falls where it falls most.
    """

    kind: PlateKind
    key: str
    stated: tuple[float, ...]
    right: tuple[float, ...]
    words: str
    times_better: float

    @property
    def sentence(self) -> str:
        """The finding in words."""
        return (
            f"The force plate is probably described wrongly: {self.words}. That explains its wrench"
            f" up to {self.times_better:.2g} times better; correct `plate.{self.key}` in the cell"
            " file. Nothing is said of torque constants until then."
        )
