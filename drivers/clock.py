"""`Clock`: the time that a link's deadlines are in, the computer's or a simulated bus's."""

from __future__ import annotations

import time
from abc import abstractmethod
from typing import Protocol

from config.errors import TransportError
from drivers.python_can import can


class Clock(Protocol):
    """Time as the cell has it: the computer's, or a simulated cell's in lock-step."""

    @abstractmethod
    def now_s(self) -> float:
        """Return the time since an arbitrary start [s]; never runs backwards."""

    @abstractmethod
    def sleep_until(self, time_s: float) -> None:
        """Return not before `time_s`, an absolute time of this clock [s]."""


class MonotonicClock:
    """The computer's monotonic clock, untouched by changes of the date."""

    def now_s(self) -> float:
        """Return CLOCK_MONOTONIC [s]."""
        return time.monotonic()

    def sleep_until(self, time_s: float) -> None:
        """Sleep to an absolute deadline; returns at once when it has passed."""
        while (remaining_s := time_s - time.monotonic()) > 0.0:
            time.sleep(remaining_s)


class SimulatedClock:
    """A simulated bus's clock, with typed errors."""

    def __init__(self, clock: Clock, bus_name: str) -> None:
        self._clock = clock
        self._bus_name = bus_name
        self.now_s = clock.now_s

    def sleep_until(self, time_s: float) -> None:
        """Let simulated time run; raises `TransportError` when the simulation is gone."""
        try:
            self._clock.sleep_until(time_s)
        except (can.CanError, OSError) as error:
            raise TransportError(
                f"CAN bus {self._bus_name}: the simulated time stopped ({error})"
            ) from error
