"""`DrivenAxis`: what a drive tells its motor, and what its objects show of the axis.

All that a drive and its axis know of each other are an `AxisPort` and a `MotorCommand`.
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


class MotorCommand(NamedTuple):
    """What a drive tells its motor over an interval; without power the brake is closed.

    Velocities in increments per second, linear in between; `torque_limit` in rated torques.
    """

    velocity_start: float
    velocity_end: float
    powered: bool
    torque_limit: float


class FollowingError:
    """The integral of the velocity demand, compared with the encoder.

    A velocity loop with an integral part keeps that difference small - the difference is what its
    integrator holds -, so a stalled, slipping or runaway axis shows in it within moments.

    Attributes:
        counts: Demand minus actual position, 60F4h.
        due_s: When the difference will have been outside the window for too long [s]; infinity
            while it is inside.
    """

    def __init__(self, objects: ObjectDictionary, clock: DriveClock) -> None:
        self._objects = objects
        self._clock = clock
        self._demand = 0.0
        self._outside_s = math.inf
        self.counts = 0.0
        self.due_s = math.inf

    def start(self, position_counts: int) -> None:
        """Begin where the axis is: no error."""
        self._demand = float(position_counts)
        self.counts = 0.0
        self._outside_s = self.due_s = math.inf

    def follow(self, moved_counts: float, position_counts: int, now_s: float) -> None:
        """Take what the demand has moved by, and where the axis is at `now_s` [s]."""
        self._demand += moved_counts
        self.counts = self._demand - position_counts
        window = self._objects[od.FOLLOWING_ERROR_WINDOW]
        if window == od.FOLLOWING_ERROR_OFF or abs(self.counts) <= window:
            self._outside_s = self.due_s = math.inf
        elif self._outside_s == math.inf:
            self._outside_s = now_s
            self.due_s = now_s + self._clock.lasts(self._objects[od.FOLLOWING_ERROR_TIME_MS] * 1e-3)


class DrivenAxis:
    """The side of a drive that its motor and encoder are on.

    Args:
        objects: The drive's object dictionary.
        power: Its CiA 402 half, which makes the velocity demand.
        port: The axis.
        identity: Its motor, and the units of its objects.
        now_s: When the drive is switched on [s].
        clock: What the drive times everything by.

    Attributes:
        following: How far the axis is behind what it was told.
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
        """Return what the motor is told between two times [s] with nothing due in between."""
        power = self._power
        return MotorCommand(
            power.velocity_at(start_s) * self._counts_per_unit,
            power.velocity_at(end_s) * self._counts_per_unit,
            power.powered,
            self._objects[self._limit] * self._rated_per_limit,
        )

    def observe(self, now_s: float) -> None:
        """Take notice of where the axis is at `now_s` [s], after it has moved."""
        power = self._power
        if power.powered:
            velocity = 0.5 * (power.velocity_at(self._moved_s) + power.velocity_at(now_s))
            moved = velocity * self._counts_per_unit * (now_s - self._moved_s)
            self.following.follow(moved, self._port.position_counts(), now_s)
        else:
            self.following.start(self._port.position_counts())
        self._moved_s = now_s

    def refresh(self) -> None:
        """Write into the objects what is true of power stage and axis now."""
        objects, port = self._objects, self._port
        objects[od.STATUSWORD] = self._power.statusword() | self._status_bits
        objects[od.MODE_DISPLAY] = objects[od.MODE]
        objects[od.POSITION] = _wrap(port.position_counts())
        velocity = round(port.velocity_counts_s() / self._counts_per_unit)
        objects[od.VELOCITY] = _clip(velocity, _INT32_MAX)
        torque = round(port.torque_permille() * self._torque_per_permille)
        objects[self._torque] = _clip(torque, _INT16_MAX)
        objects[od.FOLLOWING_ERROR] = _clip(round(self.following.counts), _INT32_MAX)


def _wrap(counts: int) -> int:
    """Return a count as a 32-bit counter shows it."""
    (wrapped,) = struct.unpack("<i", struct.pack("<I", counts & 0xFFFF_FFFF))
    return int(wrapped)


def _clip(value: int, largest: int) -> int:
    return max(-largest, min(largest, value))
