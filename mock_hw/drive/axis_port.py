"""`AxisPort` and `Motion`: all that a simulated drive and its axis know of each other."""

from __future__ import annotations

from abc import abstractmethod
from typing import NamedTuple, Protocol


class AxisPort(Protocol):
    """What a drive measures of its axis, in its own numbers."""

    @abstractmethod
    def position_counts(self) -> int:
        """Return the encoder's increments, 6064h."""

    @abstractmethod
    def velocity_counts_s(self) -> float:
        """Return their rate [1/s]."""

    @abstractmethod
    def torque_permille(self) -> int:
        """Return the motor's torque in 0.1 % of its rated torque, 6077h."""


class Motion(NamedTuple):
    """What a drive tells its motor over an interval; without power the brake is closed.

    Velocities in increments per second, linear in between; `torque_limit` in rated torques.
    """

    velocity_start: float
    velocity_end: float
    powered: bool
    torque_limit: float
