"""`SimulatedDevice`: the one contract of time that every simulated device keeps."""

from __future__ import annotations

from abc import abstractmethod
from typing import Protocol


class SimulatedDevice(Protocol):
    """A device as a function of what it is given and of time; it looks at no clock.

    Whoever runs it calls `advance` at `next_s` or before, and again whenever something reaches the
    device: time first, then the thing. The order of calls and their times decide everything that
    it does, so that the same calls give the same bytes.

    What is under a device (`Plant`, `ChargeAmplifier`) is no device: it has nothing to do by
    itself, and is given time together with what acts on it meanwhile.
    """

    @property
    @abstractmethod
    def next_s(self) -> float:
        """When it next has something to do by itself [s]; infinity for never."""

    @abstractmethod
    def advance(self, until_s: float) -> None:
        """Let time pass until `until_s` [s], doing what is due on the way, in order.

        Afterwards `next_s` lies beyond `until_s`.
        """
