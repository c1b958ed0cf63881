"""`SimulatedDevice`: interface by which all simulated devices get the time."""

from __future__ import annotations

from abc import abstractmethod
from typing import Protocol


class SimulatedDevice(Protocol):
    """A device whose state depends only on its inputs and their times; it reads no clock.

    The caller calls `advance` at `next_s` or earlier, and before every input to the device. The
    order and the times of the calls determine all outputs: equal calls give equal bytes.

    Parts of a device, such as `Plant` and `ChargeAmplifier`, do not have this interface: they do
    nothing without an input, and get the time together with each input.
    """

    @property
    @abstractmethod
    def next_s(self) -> float:
        """Time of the device's next action, if it gets no input [s]; infinity if it has none."""

    @abstractmethod
    def advance(self, until_s: float) -> None:
        """Advance time to `until_s` [s] and do all actions that are due, in order.

        Afterwards `next_s` is later than `until_s`.
        """
