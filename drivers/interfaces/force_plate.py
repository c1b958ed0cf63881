"""`ForcePlate`: an eight-channel force plate with its charge amplifier.

To add an amplifier, write a class with the methods of `ForcePlate`: settings are read back as
`PlateSetting`, the stream is returned in pieces as `PlateRead`. Any problem of the line is a
`config.errors.DriverError` (`TransportError` if the line is lost: the recorder then waits for its
return). An example is `drivers.amplifier.amplifier.SerialAmplifier`.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class PlateSetting:
    """One setting of a force plate's amplifier as required and as read back.

    Attributes:
        name: The setting's name, in words.
        channel: 1 to 8; 0 for a setting of all channels.
        required, found: Values in words.
        verdict: ``"ok"`` or ``"red"``.
    """

    name: str
    channel: int
    required: str
    found: str
    verdict: Literal["ok", "red"]


@dataclass(frozen=True, slots=True)
class PlateRead:
    """Result of one read of a force plate's stream.

    Attributes:
        rows: `drivers.amplifier.frames.PLATE_ROW`, in the order sent.
        events: `drivers.amplifier.frames.PLATE_EVENT`, in the order sent.
        arrival_s: Arrival of each row on the cell's clock [s], shape (rows,); rows of one piece
            have the same arrival.
        event_arrival_s: Arrival of each event on the computer's monotonic clock [s], shape
            (events,).
        read_s: Arrival of the last piece on the computer's monotonic clock [s].
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
        """End a stream that is running; return maker, model and serial number of the device."""

    @abstractmethod
    def settings(self) -> tuple[PlateSetting, ...]:
        """Read every setting back, without a change."""

    @abstractmethod
    def configure(self) -> bool:
        """Change the settings that differ; return whether that discharged the channels."""

    @abstractmethod
    def operate(self) -> None:
        """Start the measurement: the channels hold their charge. Zero is as at the last reset."""

    @abstractmethod
    def reset(self) -> None:
        """Discharge every channel and keep it at zero."""

    @abstractmethod
    def is_operating(self) -> bool:
        """Return whether the channels measure."""

    @abstractmethod
    def take_overloads(self) -> tuple[bool, ...]:
        """Return which channels were overloaded since the last call, and clear these flags."""

    @abstractmethod
    def forces_n(self) -> NDArray[np.float64]:
        """Return the present reading of the channels [N], shape (8,)."""

    @abstractmethod
    def start(self) -> None:
        """Begin the stream of rows."""

    @abstractmethod
    def gather(self, until_s: float) -> bool:
        """Store incoming data until `until_s` [s, monotonic clock], for `read`.

        Return whether data came.
        """

    @abstractmethod
    def read(self, until_s: float) -> PlateRead:
        """Gather, and return all data since the last call."""

    @abstractmethod
    def mark(self) -> float:
        """Request the device's time within the stream; return when [s, monotonic clock]."""

    @abstractmethod
    def forget_overloads(self) -> None:
        """Request the overloads within the stream, which clears those that are over."""

    @abstractmethod
    def stop(self, until_s: float) -> tuple[PlateRead, ...]:
        """End the stream; return the data until then."""
