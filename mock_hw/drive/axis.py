"""`DrivenAxis`: commands of a drive to its motor; measured values of the axis in its objects.

A drive reads its axis only through an `AxisPort`, and drives it only by `MotorCommand`s.
"""

from __future__ import annotations

import math
import struct
from abc import abstractmethod
from typing import NamedTuple, Protocol

from config.cell.fixed_pdo import object_address
from config.cell.servo_profile import TorqueObject
from drivers.canopen.sdo import object_name
from mock_hw.drive import objects as od
from mock_hw.drive.object_dictionary import ObjectDictionary
from mock_hw.drive.objects import SimulatedIdentity
from mock_hw.drive.power_stage import DriveClock, PowerStage

_INT16_MAX = 2**15 - 1
_INT32_MAX = 2**31 - 1


class AxisPort(Protocol):
    """Interface for the measured values of a drive's axis, in the drive's units."""

    @abstractmethod
    def position_counts(self) -> int:
        """Return the encoder position, 6064h [increments]."""

    @abstractmethod
    def velocity_counts_s(self) -> float:
        """Return the encoder velocity [increments/s]."""

    @abstractmethod
    def torque_permille(self) -> int:
        """Return the motor torque, 6077h [0.1 % of its rated torque]."""

    @abstractmethod
    def digital_inputs(self) -> int:
        """Return the levels of the digital inputs, 60FDh."""


class MotorCommand(NamedTuple):
    """Command of a drive to its motor for an interval of time.

    Attributes:
        velocity_start: Velocity at the beginning [increments/s].
        velocity_end: Velocity at the end [increments/s]; it changes linearly during the interval.
        powered: True if the velocity loop runs; if False, the brake is closed.
        torque_limit: Torque limit, as a multiple of the rated torque.
    """

    velocity_start: float
    velocity_end: float
    powered: bool
    torque_limit: float


class FollowingError:
    """Following error: integral of the velocity demand minus the encoder position.

    A velocity loop with integral action keeps this difference small. A stalled, slipping or runaway
    axis therefore causes a large following error quickly.

    Attributes:
        counts: Integrated demand minus actual position, 60F4h [increments].
        due_s: Time at which the error will have been outside the window (6065h) for too long
            (6066h) [s]; infinity while it is inside.
    """

    def __init__(self, objects: ObjectDictionary, clock: DriveClock) -> None:
        self._objects = objects
        self._clock = clock
        self._demand = 0.0
        self._outside_s = math.inf
        self.counts = 0.0
        self.due_s = math.inf

    def start(self, position_counts: int) -> None:
        """Reset the error to zero at the present position."""
        self._demand = float(position_counts)
        self.counts = 0.0
        self._outside_s = self.due_s = math.inf

    def follow(self, moved_counts: float, position_counts: int, now_s: float) -> None:
        """Update the error after a move of the demand and a new position of the axis."""
        self._demand += moved_counts
        self.counts = self._demand - position_counts
        window = self._objects[od.FOLLOWING_ERROR_WINDOW]
        if window == od.FOLLOWING_ERROR_OFF or abs(self.counts) <= window:
            self._outside_s = self.due_s = math.inf
        elif self._outside_s == math.inf:
            self._outside_s = now_s
            self.due_s = now_s + self._clock.true_duration_s(
                self._objects[od.FOLLOWING_ERROR_TIME_MS] * 1e-3
            )


class DrivenAxis:
    """The part of a simulated drive that is connected to the motor and the encoder.

    Args:
        objects: The drive's object dictionary.
        power: The drive's power stage, which computes the velocity demand.
        port: Measured values of the axis.
        identity: Properties of the motor, and units of the objects.
        now_s: Switch-on time of the drive [s].
        clock: The drive's clock.

    Attributes:
        following: Following error of the axis.
    """

    def __init__(
        self,
        objects: ObjectDictionary,
        power: PowerStage,
        port: AxisPort,
        identity: SimulatedIdentity,
        now_s: float,
        clock: DriveClock,
    ) -> None:
        self._objects = objects
        self._power = power
        self._port = port
        units, motor, profile = identity.units, identity.motor, identity.profile
        self._counts_per_unit = units.counts_per_rad / units.velocity_units_per_rad_s
        permille_nm = 1e-6 * identity.rated_torque_mnm
        self._torque = od.TORQUE if profile.pdos else object_address(profile.torque.object)
        self._torque_per_permille = permille_nm / motor.nm_per_unit(profile.torque)
        limit = profile.torque_limit or TorqueObject(object=object_name(*od.TORQUE_LIMIT))
        self._limit = object_address(limit.object)
        self._rated_per_limit = 1e-3 * motor.nm_per_unit(limit) / permille_nm
        bits = profile.referenced
        of_status = bits is not None and bits.object == object_name(*od.STATUSWORD)
        self._status_bits = identity.referenced_bits if of_status else 0
        self._moved_s = now_s
        self.following = FollowingError(objects, clock)

    def command(self, start_s: float, end_s: float) -> MotorCommand:
        """Return the motor's command for a time interval [s] without events."""
        power = self._power
        return MotorCommand(
            power.velocity_at(start_s) * self._counts_per_unit,
            power.velocity_at(end_s) * self._counts_per_unit,
            power.powered,
            self._objects[self._limit] * self._rated_per_limit,
        )

    def observe(self, now_s: float) -> None:
        """Update the following error after the axis has moved until `now_s` [s]."""
        power = self._power
        if power.powered:
            velocity = 0.5 * (power.velocity_at(self._moved_s) + power.velocity_at(now_s))
            moved = velocity * self._counts_per_unit * (now_s - self._moved_s)
            self.following.follow(moved, self._port.position_counts(), now_s)
        else:
            self.following.start(self._port.position_counts())
        self._moved_s = now_s

    def refresh(self) -> None:
        """Write the present state of the power stage and the axis into the objects."""
        objects, port = self._objects, self._port
        objects[od.STATUSWORD] = self._power.statusword() | self._status_bits
        objects[od.MODE_DISPLAY] = objects[od.MODE]
        objects[od.POSITION] = _wrap(port.position_counts())
        velocity = round(port.velocity_counts_s() / self._counts_per_unit)
        objects[od.VELOCITY] = _clip(velocity, _INT32_MAX)
        torque = round(port.torque_permille() * self._torque_per_permille)
        objects[self._torque] = _clip(torque, _INT16_MAX)
        objects[od.DIGITAL_INPUTS] = port.digital_inputs()
        objects[od.FOLLOWING_ERROR] = _clip(round(self.following.counts), _INT32_MAX)


def _wrap(counts: int) -> int:
    """Return a count wrapped to the range of signed 32-bit numbers."""
    (wrapped,) = struct.unpack("<i", struct.pack("<I", counts & 0xFFFF_FFFF))
    return int(wrapped)


def _clip(value: int, largest: int) -> int:
    return max(-largest, min(largest, value))
