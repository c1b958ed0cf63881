"""`DriveMonitor`: the drives' parameters and temperatures, read in parallel to the cyclic exchange.

To add a monitor, write a class with the methods of `DriveMonitor`. It runs in its own process, so
its waits do not delay the cyclic exchange. If a drive does not answer `read`, its values are NaN
and `problems` has a sentence about it; `read` raises `config.errors.DriverError` only if the line
is lost. `motors` also raises it if a drive does not answer. An example is
`drivers.modbus.drive_monitor`.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class MotorData:
    """Properties of a motor that are stored in its drive; NaN for unknown values.

    Attributes:
        torque_constant_nm_per_a: Torque constant at the reference temperature, without the gear.
        torque_constant_per_k: Relative change of the torque constant per kelvin.
        reference_temperature_k: Temperature at which the torque constant is stated.
        rated_torque_nm, rated_current_a, rotor_inertia_kg_m2: Values of the motor, without the
            gear.
    """

    torque_constant_nm_per_a: float
    torque_constant_per_k: float
    reference_temperature_k: float
    rated_torque_nm: float
    rated_current_a: float
    rotor_inertia_kg_m2: float


@dataclass(frozen=True, slots=True)
class MonitorReading:
    """The drives' answers in one reading of all drives.

    Attributes:
        temperature_k, operating_time_s: Shape (n,). Temperature of each joint's motor [K], and time
            since its drive was switched on [s]; NaN if the drive did not answer plausibly or has no
            such register.
        problems: Reasons of missing answers, one sentence each.
    """

    temperature_k: NDArray[np.float64]
    operating_time_s: NDArray[np.float64]
    problems: tuple[str, ...]


class DriveMonitor(Protocol):
    """Reader of the drives' parameters and temperatures, in parallel to the cyclic exchange.

    `motors` and `read` ask every drive, from base to flange. Every call returns after a limited
    time.
    """

    @abstractmethod
    def motors(self) -> tuple[MotorData, ...]:
        """Return the properties of the motors that the drives store."""

    @abstractmethod
    def read(self) -> MonitorReading:
        """Return the present temperatures; those of a drive that does not answer are NaN."""

    @abstractmethod
    def close(self) -> None:
        """Close the line."""
