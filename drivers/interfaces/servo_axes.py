"""`ServoAxes`: all axes of a robot as the cyclic task drives them, independent of the bus.

To add drives on another bus, write a class with the members of `ServoAxes`. Requirements:

- `bring_up` resets, configures and reads back every drive without power, and raises
  `config.errors.PreflightError` if one is not as required; `settings` returns all results even
  then.
- `exchange` is one cycle on the bus. It returns when all drives have answered, or after
  `answers_within_s`; a drive that did not answer keeps its last values and is not `received`.
- `command` sends velocities only while every axis is enabled. Once one is not, or `quick_stop` was
  called, it sends a quick stop instead and returns False, until `bring_up` has been run again: no
  old command may move the robot when power returns.
- `quick_stop`, `halt` and `disable` are tried for every axis before anything is raised.
- Data of a device are never trusted: implausible data become a `DriveEvent`, or no answer.

An implementation is `drivers.servo.axes.CanServoAxes`, CiA 402 drives on CANopen; `drivers.cell`
opens it.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from config.arrays import FloatArray


class EventKind(IntEnum):
    """Kind of an event that a drive, or the bus, reported unasked."""

    EMERGENCY = 1
    EMERGENCY_CLEARED = 2
    BOOT_UP = 3
    HEARTBEAT_LOST = 4
    NOT_OPERATIONAL = 5
    WRONG_LENGTH = 6
    FOREIGN_MASTER = 7
    UNEXPECTED_FRAME = 8

    @property
    def is_fault(self) -> bool:
        """True if motion must not continue after it."""
        return self not in (EventKind.EMERGENCY_CLEARED, EventKind.UNEXPECTED_FRAME)


@dataclass(frozen=True, slots=True)
class DriveEvent:
    """An event outside the cyclic data.

    Attributes:
        joint: Name of the joint, empty if the event concerns no joint.
        time_s: Time at which it was noticed, on the link's clock [s].
        text: One sentence for people; text from a device is escaped in it.
        code: Emergency error code, heartbeat state, number of bytes or identifier, by `kind`.
    """

    kind: EventKind
    joint: str
    time_s: float
    text: str
    code: int = 0


@dataclass(frozen=True, slots=True)
class DriveSetting:
    """One object of a drive as required and as read back.

    Attributes:
        joint, node_id: The drive.
        object_name: The object, such as ``6007h:00``.
        name: The object's name, in words.
        required, found: Values in words; `required` is empty for an object that is only shown,
            `found` is the reason if the object could not be read.
        verdict: ``"ok"``, ``"red"`` (no motion), ``"allowed"`` (would be red; the cell file names
            this drive in allow_drive_without_watchdog) or ``"shown"``.
        next_action: What to do if it is red; empty if that follows from the object alone.
        code: Stable name of the refusal if it is red; empty for settings without their own code.
    """

    joint: str
    node_id: int
    object_name: str
    name: str
    required: str
    found: str
    verdict: Literal["ok", "red", "allowed", "shown"]
    next_action: str = ""
    code: str = ""


@dataclass(eq=False, slots=True)
class Answers:
    """The drives' answers of the latest cycle; the arrays are allocated once and reused.

    A drive that did not answer keeps its last values. With a coupled wrist `position` is still the
    joints'; all other values are those of the joint's drive.

    Attributes:
        received: Shape (joints,). Whether the answer came in time and was not contradicted.
        position: Shape (joints,). Of the joints [rad or m].
        torque_nm: Shape (joints,). Of the motors, at the link side of their gears [N m or N].
        enabled, fault: Shape (joints,). Whether the drive reports that it follows velocities, and
            that it is in fault.
        position_counts: Shape (joints,). As received, for the record.
        torque_raw: Shape (joints,). As received, for the record.
        statusword: Shape (joints,). As received, for the record and for people; `enabled` and
            `fault` are its meaning.
        late_frames: Number of answers so far that came after their cycle; they are not used.
        second_answers: Shape (joints,). Number of cycles so far in which each drive's identifier
            answered more than once.
    """

    received: NDArray[np.bool_]
    position: NDArray[np.float64]
    torque_nm: NDArray[np.float64]
    enabled: NDArray[np.bool_]
    fault: NDArray[np.bool_]
    position_counts: NDArray[np.int32]
    torque_raw: NDArray[np.int16]
    statusword: NDArray[np.uint16]
    second_answers: NDArray[np.int64]
    late_frames: int = 0

    @classmethod
    def before_any(cls, joints: int) -> Answers:
        """Return the arrays before the first cycle: no answer, all zero."""
        return cls(
            received=np.zeros(joints, dtype=np.bool_),
            position=np.zeros(joints),
            torque_nm=np.zeros(joints),
            enabled=np.zeros(joints, dtype=np.bool_),
            fault=np.zeros(joints, dtype=np.bool_),
            position_counts=np.zeros(joints, dtype=np.int32),
            torque_raw=np.zeros(joints, dtype=np.int16),
            statusword=np.zeros(joints, dtype=np.uint16),
            second_answers=np.zeros(joints, dtype=np.int64),
        )


class ServoAxes(Protocol):
    """All axes of a robot, commanded together by velocity.

    Order of the calls: `bring_up`, `start`, `enable`; then, in every cycle, `exchange`, `command`,
    `send_heartbeat`; at the end `quick_stop` and `disable`. Long operations between `start` and
    `enable` must call `keep_alive`.

    Attributes:
        joint_names: Base to flange; the order of every array.
        answers: The drives' last answers; `exchange` fills it.
        answers_within_s: Time limit of the answers after the beginning of a cycle [s].
    """

    joint_names: tuple[str, ...]
    answers: Answers
    answers_within_s: float

    @abstractmethod
    def bring_up(self) -> None:
        """Configure every drive and read everything back; no power, no motion."""

    @abstractmethod
    def settings(self) -> tuple[DriveSetting, ...]:
        """Return the required and actual settings of the last `bring_up`."""

    @abstractmethod
    def start(self) -> None:
        """Begin the cyclic exchange, still without power."""

    @abstractmethod
    def keep_alive(self, now_s: float) -> None:
        """Prevent a timeout of the drives between `start` and `enable`, during long operations.

        Args:
            now_s: The time [s].
        """

    @abstractmethod
    def enable(self) -> float:
        """Switch every drive on, at velocity 0; return the beginning of its last cycle [s]."""

    @abstractmethod
    def exchange(self) -> float:
        """Run a cycle and fill `answers` with the drives' answers; return its beginning [s]."""

    @abstractmethod
    def command(self, velocity: FloatArray) -> bool:
        """Send velocities, which act in the next cycle.

        Args:
            velocity: Shape (joints,). At the joints [rad/s or m/s].

        Returns:
            False: not sent; the axes were stopped instead.
        """

    @abstractmethod
    def send_heartbeat(self, now_s: float) -> None:
        """Send this computer's heartbeat if it is due at `now_s` [s]."""

    @abstractmethod
    def take_events(self) -> tuple[DriveEvent, ...]:
        """Return the events since the last call."""

    @abstractmethod
    def bus_notes(self) -> tuple[str, ...]:
        """Return notes on the bus, such as other senders on it."""

    @abstractmethod
    def quick_stop(self) -> None:
        """Command a quick stop to every axis at once, before anything is raised."""

    @abstractmethod
    def halt(self) -> bool:
        """Quick stop and wait, a limited time, until no drive moves; return whether all rest."""

    @abstractmethod
    def disable(self) -> tuple[str, ...]:
        """Switch the power off; return the joints that did not confirm it."""
