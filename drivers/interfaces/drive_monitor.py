"""`DriveMonitor`: the drives' parameters and temperatures, asked beside the cyclic exchange.

To add a monitor, write a class with the methods of `DriveMonitor`. It runs in a process of its own,
where a wait harms nobody: a drive that does not answer is NaN and a sentence in `problems`; only a
line that is gone raises `config.errors.DriverError`. `drivers.modbus.drive_monitor` has one.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class MotorData:
    """What a drive says of its motor; NaN for what it does not say.

    Attributes:
        torque_constant_nm_per_a, torque_constant_per_k, reference_temperature_k: Of the motor,
            before its gear: at the reference temperature, its relative change per kelvin, and that
            temperature.
        rated_torque_nm, rated_current_a, rotor_inertia_kg_m2: Of the motor.
    """

    torque_constant_nm_per_a: float
    torque_constant_per_k: float
    reference_temperature_k: float
    rated_torque_nm: float
    rated_current_a: float
    rotor_inertia_kg_m2: float


@dataclass(frozen=True, slots=True)
class MonitorReading:
    """What the drives said in one round.

    Attributes:
        temperature_k, operating_time_s: Shape (n,). Of each joint's motor [K], and since its drive
            was switched on [s]; NaN where it did not answer, or has no such register.
        problems: Why a drive did not answer, one sentence each.
    """

    temperature_k: NDArray[np.float64]
    operating_time_s: NDArray[np.float64]
    problems: tuple[str, ...]


class DriveMonitor(Protocol):
    """A way to the drives' parameters and temperatures beside the cyclic exchange.

    Every call asks every drive, base to flange, and waits a limited time.
    """

    @abstractmethod
    def motors(self) -> tuple[MotorData, ...]:
        """Return what the drives say of their motors."""

    @abstractmethod
    def read(self) -> MonitorReading:
        """Return temperatures; a drive that does not answer does not keep the others' away."""

    @abstractmethod
    def close(self) -> None:
        """Close the line."""
