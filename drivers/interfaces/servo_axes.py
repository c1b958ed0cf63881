"""`ServoAxes`: all axes of a robot as the cyclic task drives them, independent of the bus.

To add drives on another bus, write a class with the members of `ServoAxes`. Requirements:

- `bring_up` resets, configures and reads back every drive without power, and raises
  `config.errors.PreflightError` if a drive's value is not as required; even after this error,
  `settings` returns the results of all drives.
- `exchange` is one cycle on the bus. It returns when all drives have answered, or after
  `answers_within_s`; the values of a drive that did not answer remain unchanged, and its `received`
  is False.
- `command` sends velocities only while every axis is enabled. After an axis has lost this state, or
  after `quick_stop`, it sends a quick stop instead and returns False until `bring_up` has been run
  again. No old command can therefore move the robot when power returns.
- `quick_stop`, `halt` and `disable` try to reach every axis before they raise an error.
- Data from a device are always checked: implausible data become a `DriveEvent`, or count as a
  missing answer.

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
    """Kind of an event that a drive or the bus reported without a request."""

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
        """True if motion must not continue after an event of this kind."""
        return self not in (EventKind.EMERGENCY_CLEARED, EventKind.UNEXPECTED_FRAME)


@dataclass(frozen=True, slots=True)
class DriveEvent:
    """An event that is not part of the cyclic data, such as an emergency message.

    Attributes:
        joint: Name of the joint, empty if the event concerns no joint.
        time_s: Time at which it was noticed, on the link's clock [s].
        text: Description in one sentence; in text from a device, unprintable characters are
            escaped.
        code: Number that belongs to `kind`: emergency error code, NMT state in a heartbeat, number
            of bytes, or identifier.
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
        verdict: ``"ok"``; ``"red"``: motion is refused; ``"allowed"``: not as required, but the
            cell file accepts this by naming the drive in allow_drive_without_watchdog; ``"shown"``:
            only reported: no value is required, or the drive may lack the object.
        next_action: What to do if the verdict is red; empty if this is clear from the object.
        code: Error code (RID-…) of the refusal if the verdict is red; empty for settings that have
            no code of their own.
        headline: Name under which a summary shows the result even if it is not red.
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
    headline: str = ""


@dataclass(eq=False, slots=True)
class Answers:
    """The drives' answers of the latest cycle; the arrays are allocated once and reused.

    The values of a drive that did not answer remain unchanged. In a robot with a coupled wrist,
    `position` refers to the joints; all other values refer to the drives' motors.

    Attributes:
        received: Shape (joints,). True if the answer came in time and no second answer contradicted
            it.
        position: Shape (joints,). Positions of the joints [rad or m].
        torque_nm: Shape (joints,). Torques of the motors, at the link side of their gears [N m or
            N].
        enabled, fault: Shape (joints,). True if the drive reports that it is enabled (follows
            velocities), and that it is in fault.
        position_counts: Shape (joints,). Position as received [encoder counts], for the journal.
        torque_raw: Shape (joints,). Torque as received, in the drive's unit, for the journal.
        statusword: Shape (joints,). Status word as received, for the journal and for messages; the
            program uses `enabled` and `fault`, which are derived from it.
        inputs: Shape (joints,). Digital inputs as received, 60FDh; 0 of a drive that does not send
            them.
        late_frames: Number of answers so far that came too late for their cycle; they are not used.
        second_answers: Shape (joints,). Number of cycles so far in which more than one answer came
            with the drive's identifier.
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
    inputs: NDArray[np.uint32]
    late_frames: int = 0

    @classmethod
    def initial(cls, joints: int) -> Answers:
        """Return the values before the first cycle: no answers received, all arrays zero."""
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
            inputs=np.zeros(joints, dtype=np.uint32),
        )


class ServoAxes(Protocol):
    """All axes of a robot, commanded together by velocity.

    Order of the calls: `bring_up`, `start`, `enable`; then, in every cycle, `exchange`, `command`,
    `send_heartbeat`; at the end `quick_stop` and `disable`. A long operation between `start` and
    `enable` must call `keep_alive` repeatedly.

    Attributes:
        joint_names: Names of the joints from base to flange; all arrays have this order.
        answers: The drives' last answers; `exchange` fills it.
        answers_within_s: Time from the beginning of a cycle until which answers are awaited [s].
    """

    joint_names: tuple[str, ...]
    answers: Answers
    answers_within_s: float

    @abstractmethod
    def bring_up(self) -> None:
        """Configure every drive and read all values back, without power and motion."""

    @abstractmethod
    def settings(self) -> tuple[DriveSetting, ...]:
        """Return the required and actual settings of the last `bring_up`."""

    @abstractmethod
    def start(self) -> None:
        """Begin the cyclic exchange; the drives stay without power."""

    @abstractmethod
    def keep_alive(self, now_s: float) -> None:
        """Prevent the drives' timeouts during a long operation between `start` and `enable`.

        Args:
            now_s: The present time on the cell's clock [s].
        """

    @abstractmethod
    def enable(self) -> float:
        """Switch every drive on, at velocity 0; return the start time of the last cycle [s]."""

    @abstractmethod
    def exchange(self) -> float:
        """Run a cycle and fill `answers`; return the start time of the cycle [s]."""

    @abstractmethod
    def command(self, velocity: FloatArray) -> bool:
        """Send velocities, which act in the next cycle.

        Args:
            velocity: Shape (joints,). Velocities of the joints [rad/s or m/s].

        Returns:
            True if the velocities were sent; False if a quick stop was sent instead.
        """

    @abstractmethod
    def send_heartbeat(self, now_s: float) -> None:
        """Send this computer's heartbeat if it is due at `now_s` [s]."""

    @abstractmethod
    def take_events(self) -> tuple[DriveEvent, ...]:
        """Return the events since the last call."""

    @abstractmethod
    def bus_notes(self) -> tuple[str, ...]:
        """Return remarks about the bus, such as other senders that were detected."""

    @abstractmethod
    def quick_stop(self) -> None:
        """Command a quick stop to all axes at once; raise errors only afterwards."""

    @abstractmethod
    def halt(self) -> bool:
        """Quick stop; wait a limited time until no drive moves; return True if all are at rest."""

    @abstractmethod
    def disable(self) -> tuple[str, ...]:
        """Switch the power off; return the joints whose drive did not confirm this."""
