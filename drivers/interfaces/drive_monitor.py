"""`DriveMonitor`: the drives' parameters and temperatures, read in parallel to the cyclic exchange.

To add a monitor, write a class with the methods of `DriveMonitor`. It runs in its own process, in
which waiting does no harm. A drive that does not answer gives NaN and a sentence in `problems`;
only a lost line raises `config.errors.DriverError`. An example is `drivers.modbus.drive_monitor`.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class MotorData:
    """A drive's data of its motor; NaN for unknown values.

    Attributes:
        torque_constant_nm_per_a, torque_constant_per_k, reference_temperature_k: Values of the
            motor, before its gear: at the reference temperature, the relative change per kelvin,
            and that temperature.
        rated_torque_nm, rated_current_a, rotor_inertia_kg_m2: Values of the motor.
    """

    torque_constant_nm_per_a: float
    torque_constant_per_k: float
    reference_temperature_k: float
    rated_torque_nm: float
    rated_current_a: float
    rotor_inertia_kg_m2: float


@dataclass(frozen=True, slots=True)
class MonitorReading:
    """The drives' answers of one round.

    Attributes:
        temperature_k, operating_time_s: Shape (n,). Temperature of each joint's motor [K], and time
            since its drive was switched on [s]; NaN if it did not answer or lacks the register.
        problems: Reasons of missing answers, one sentence each.
    """

    temperature_k: NDArray[np.float64]
    operating_time_s: NDArray[np.float64]
    problems: tuple[str, ...]


class DriveMonitor(Protocol):
    """Reader of the drives' parameters and temperatures, in parallel to the cyclic exchange.

    Every call reads from every drive, base to flange, and waits a limited time.
    """

    @abstractmethod
    def motors(self) -> tuple[MotorData, ...]:
        """Return the drives' data of their motors."""

    @abstractmethod
    def read(self) -> MonitorReading:
        """Return temperatures; a drive that does not answer does not affect the others."""

    @abstractmethod
    def close(self) -> None:
        """Close the line."""
