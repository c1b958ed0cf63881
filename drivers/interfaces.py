"""What can be asked of the devices, whatever the bus: axes, force plate, drive monitor."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray


class EventKind(IntEnum):
    """What a drive, or the bus, made known by itself."""

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
        """Whether motion must not go on after it."""
        return self not in (EventKind.EMERGENCY_CLEARED, EventKind.UNEXPECTED_FRAME)


@dataclass(frozen=True, slots=True)
class DriveEvent:
    """Something that happened outside the cyclic data.

    Attributes
    ----------
    kind
        What it was.
    joint
        Name of the joint, empty where the event belongs to none.
    time_s
        When it was noticed, on the link's clock [s].
    text
        One sentence for people; what a device sent is escaped in it.
    code
        Emergency error code, heartbeat state, number of bytes or identifier, by `kind`.
    """

    kind: EventKind
    joint: str
    time_s: float
    text: str
    code: int = 0


@dataclass(frozen=True, slots=True)
class DriveSetting:
    """One object of a drive as required and as read back.

    Attributes
    ----------
    joint, node_id
        Which drive.
    object_name
        The object, as ``6007h:00``.
    name
        What it is, in words.
    required, found
        Values in words; `required` is empty for an object that is only shown, `found` says why when
        the object could not be read.
    verdict
        ``"ok"``, ``"red"`` (no motion), ``"allowed"`` (would be red; the cell file names this drive
        in allow_drive_without_watchdog) or ``"shown"``.
    next_action
        What to do where it is red; empty where that follows from the object alone.
    """

    joint: str
    node_id: int
    object_name: str
    name: str
    required: str
    found: str
    verdict: Literal["ok", "red", "allowed", "shown"]
    next_action: str = ""


class ServoAxes(Protocol):
    """All axes of a robot, commanded together, in the cyclic synchronous velocity mode.

    In order: `bring_up`, `start`, `enable`; then, every cycle, `sync`, `collect`, `command`,
    `send_heartbeat`; at the end `quick_stop` and `disable`. Arrays have one element a joint, base
    to flange; they are overwritten by every `collect`. With a coupled wrist, `position` is the
    joints' all the same, and so are the velocities of `command`; everything else is that of the
    joint's drive.
    """

    joint_names: tuple[str, ...]
    received: NDArray[np.bool_]
    position: NDArray[np.float64]
    torque_nm: NDArray[np.float64]
    position_counts: NDArray[np.int32]
    torque_raw: NDArray[np.int16]
    statusword: NDArray[np.uint16]
    second_answers: NDArray[np.int64]
    """In how many cycles so far each drive's identifier answered more than once."""

    @property
    @abstractmethod
    def late_frames(self) -> int:
        """How many answers came after their cycle so far; they are not used."""

    @abstractmethod
    def bus_notes(self) -> tuple[str, ...]:
        """Return what a person should know of the bus, such as who else sends on it."""

    @abstractmethod
    def bring_up(self) -> None:
        """Configure every drive and read everything back; no power, no motion."""

    @abstractmethod
    def settings(self) -> tuple[DriveSetting, ...]:
        """Return what the last `bring_up` required and found."""

    @abstractmethod
    def start(self) -> None:
        """Begin the cyclic exchange, still without power."""

    @abstractmethod
    def enable(self) -> float:
        """Switch every drive on, at velocity 0; return the time of the last SYNC [s]."""

    @abstractmethod
    def sync(self) -> float:
        """Begin a cycle; return its time [s]."""

    @abstractmethod
    def collect(self, deadline_s: float) -> None:
        """Take the drives' answers of this cycle into the arrays, waiting until `deadline_s`."""

    @abstractmethod
    def command(self, velocity: NDArray[np.float64]) -> bool:
        """Send velocities [rad/s, joint side]; False: not sent, the axes were stopped instead."""

    @abstractmethod
    def send_heartbeat(self, now_s: float) -> None:
        """Send this computer's heartbeat when it is due."""

    @abstractmethod
    def take_events(self) -> tuple[DriveEvent, ...]:
        """Return what happened since the last call."""

    @abstractmethod
    def quick_stop(self) -> None:
        """Command a quick stop to every axis at once, before anything is raised."""

    @abstractmethod
    def halt(self) -> bool:
        """Quick stop and wait, a limited time, until no drive moves; return whether all rest."""

    @abstractmethod
    def disable(self) -> tuple[str, ...]:
        """Take the power away; return the joints that did not confirm it."""


@dataclass(frozen=True, slots=True)
class PlateSetting:
    """One setting of a force plate's amplifier as required and as read back.

    Attributes
    ----------
    name
        What it is, in words.
    channel
        1 to 8; 0 for what belongs to all.
    required, found
        Values in words.
    verdict
        ``"ok"`` or ``"red"``.
    """

    name: str
    channel: int
    required: str
    found: str
    verdict: Literal["ok", "red"]


@dataclass(frozen=True, slots=True)
class PlateRead:
    """What one read of a force plate's stream brought.

    Attributes
    ----------
    rows
        `drivers.amplifier.frames.PLATE_ROW`, in the order sent.
    events
        `drivers.amplifier.frames.PLATE_EVENT`, in the order sent.
    arrival_s
        When each row was here, on the cell's clock [s], shape (rows,); rows that one piece brought
        arrived together.
    event_arrival_s
        When each event was here, on the computer's monotonic clock [s], shape (events,).
    read_s
        When the last piece was here, on the computer's monotonic clock [s].
    """

    rows: NDArray[Any]
    events: NDArray[Any]
    arrival_s: NDArray[np.float64]
    event_arrival_s: NDArray[np.float64]
    read_s: float


class ForcePlate(Protocol):
    """An eight-channel force plate with its charge amplifier.

    In order: `connect`, `configure`, `operate`; then `start`, `read` again and again, `stop`.
    Channels are those of `config.cell.plate`.
    """

    @abstractmethod
    def connect(self) -> str:
        """End a stream that is under way; return who answers: maker, model, serial number."""

    @abstractmethod
    def settings(self) -> tuple[PlateSetting, ...]:
        """Read every setting back; nothing is changed."""

    @abstractmethod
    def configure(self) -> bool:
        """Change the settings that differ; return whether that lost the charges on the channels."""

    @abstractmethod
    def operate(self) -> None:
        """Measure: from now on the channels hold their charge. Zero is where it was at reset."""

    @abstractmethod
    def reset(self) -> None:
        """Discharge every channel and keep it at zero."""

    @abstractmethod
    def is_operating(self) -> bool:
        """Return whether the channels measure."""

    @abstractmethod
    def take_overloads(self) -> tuple[bool, ...]:
        """Return which channels were overloaded since the last call, and forget it."""

    @abstractmethod
    def forces_n(self) -> NDArray[np.float64]:
        """Return what the channels measure now [N], shape (8,)."""

    @abstractmethod
    def start(self) -> None:
        """Begin the stream of rows."""

    @abstractmethod
    def gather(self, until_s: float) -> bool:
        """Take in what has come, waiting for it until `until_s` [s, monotonic clock], for `read`.

        Return whether anything came.
        """

    @abstractmethod
    def read(self, until_s: float) -> PlateRead:
        """Gather, and return all that was gathered since the last call."""

    @abstractmethod
    def mark(self) -> float:
        """Ask for the device's time within the stream; return when [s, monotonic clock]."""

    @abstractmethod
    def forget_overloads(self) -> None:
        """Ask for the overloads within the stream, which forgets those that are over."""

    @abstractmethod
    def stop(self, until_s: float) -> tuple[PlateRead, ...]:
        """End the stream; return what came until then."""


@dataclass(frozen=True, slots=True)
class MotorData:
    """What a drive says of its motor; NaN for what it does not say.

    Attributes
    ----------
    torque_constant_nm_per_a, torque_constant_per_k, reference_temperature_k
        Of the motor, before its gear: at the reference temperature, its relative change per kelvin,
        and that temperature.
    rated_torque_nm, rated_current_a, rotor_inertia_kg_m2
        Of the motor.
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

    Attributes
    ----------
    temperature_k, operating_time_s : ndarray, shape (n,)
        Of each joint's motor [K], and since its drive was switched on [s]; NaN where it did not
        answer, or has no such register.
    problems : tuple of str
        Why a drive did not answer, one sentence each.
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
