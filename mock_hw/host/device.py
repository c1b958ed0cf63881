"""`SimulatedDevice`: protocol for the time of all simulated devices."""

from __future__ import annotations

from abc import abstractmethod
from typing import Protocol


class SimulatedDevice(Protocol):
    """A device whose state depends only on its inputs and their times; it reads no clock.

    The caller calls `advance` at `next_s` or earlier, and before every input to the device. The
    order and the times of the calls determine all outputs, so that equal calls give equal bytes.

    Parts within a device (`Plant`, `ChargeAmplifier`) are not devices: they have no actions of
    their own, and receive time together with their inputs.
    """

    @property
    @abstractmethod
    def next_s(self) -> float:
        """Time of the device's next action of its own [s]; infinity without one."""

    @abstractmethod
    def advance(self, until_s: float) -> None:
        """Advance time to `until_s` [s] and do all actions that are due, in order.

        Afterwards `next_s` is later than `until_s`.
        """
