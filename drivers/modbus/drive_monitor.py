"""`ModbusDriveMonitor`: reads temperatures and motor data from a cell's drives over Modbus."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

import numpy as np

from config.cell.drive_profile import NAMEPLATE, POLLED, DriveProfile, Quantity
from config.cell.monitor import MonitorConfig
from config.errors import DeviceTimeoutError, ProtocolError
from config.plausible import ZERO_CELSIUS_K
from drivers.interfaces.drive_monitor import DriveMonitor, MonitorReading, MotorData
from drivers.modbus.codec import decode, plan_reads
from drivers.modbus.link import ModbusLink, open_modbus

COLDEST_K = 223.15
HOTTEST_K = 523.15
"""Limits of plausible motor temperatures [K]. Outside these limits, the register, type or scale in
the drive's profile is wrong."""


class ModbusDriveMonitor(DriveMonitor):
    """Monitor of the drives on an open Modbus line.

    Args:
        link: The Modbus line.
        units: The drives' unit numbers on the line, from base to flange.
        profile: Description of the drives' registers.
    """

    def __init__(self, link: ModbusLink, units: Sequence[int], profile: DriveProfile) -> None:
        self._link = link
        self._units = tuple(units)
        self._profile = profile
        self._polls = plan_reads(profile, POLLED)
        self._plates = plan_reads(profile, NAMEPLATE)

    def motors(self) -> tuple[MotorData, ...]:
        """Return the properties of the motors that the drives store.

        Raises:
            DriverError: A drive does not answer, or its answer does not match its profile.
        """
        answers: list[MotorData] = []
        for unit in self._units:
            values: dict[Quantity, float] = dict.fromkeys(NAMEPLATE, math.nan)
            for read in self._plates:
                values |= decode(self._profile, read, self._link.read(unit, read))
            answers.append(MotorData(**values))
        return tuple(answers)

    def read(self) -> MonitorReading:
        """Return the present temperatures; see `DriveMonitor.read`.

        Raises:
            TransportError: The line is lost.
        """
        temperature = np.full(len(self._units), math.nan)
        operating = np.full(len(self._units), math.nan)
        problems: list[str] = []
        for number, unit in enumerate(self._units):
            values: dict[Quantity, float] = {}
            try:
                for read in self._polls:
                    values |= decode(self._profile, read, self._link.read(unit, read))
            except (DeviceTimeoutError, ProtocolError) as error:
                problems.append(str(error))
                continue
            found_k = values["motor_temperature_k"]
            if COLDEST_K <= found_k <= HOTTEST_K:
                temperature[number] = found_k
            else:
                problems.append(
                    f"{self._link.name}, unit {unit}: motor temperature"
                    f" {found_k - ZERO_CELSIUS_K:.1f} °C is implausible; check register, type and"
                    " scale in the profile"
                )
            operating[number] = values.get("operating_time_s", math.nan)
        return MonitorReading(temperature, operating, tuple(problems))

    def close(self) -> None:
        """Close the line."""
        self._link.close()

    def __enter__(self) -> ModbusDriveMonitor:
        """Return the monitor itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the line."""
        self.close()


def open_drive_monitor(
    config: MonitorConfig,
    profile: DriveProfile,
    pause: Callable[[float], None] = time.sleep,
) -> ModbusDriveMonitor:
    """Open the connection to the drives that a cell file names; nothing is sent yet.

    Raises:
        TransportError: The connection cannot be opened.
    """
    return ModbusDriveMonitor(open_modbus(config, pause), config.units, profile)
