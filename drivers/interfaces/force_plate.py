"""`ForcePlate`: an eight-channel force plate with its charge amplifier.

To add an amplifier, write a class with the methods of `ForcePlate`: `PlateSetting` is the result
for one setting, `PlateRead` one piece of the stream. Any problem with the line raises
`config.errors.DriverError`; a lost line raises its subclass `TransportError`, after which the
recorder waits until the line works again. An example is
`drivers.amplifier.amplifier.SerialAmplifier`.
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
        rows: Rows of the type `drivers.amplifier.frames.PLATE_ROW`, in the order sent.
        events: Events of the type `drivers.amplifier.frames.PLATE_EVENT`, in the order sent.
        arrival_s: Arrival time of each row on the cell's clock [s], shape (rows,); rows of a real
            line that were received together have the same time.
        event_arrival_s: Arrival time of each event on the computer's monotonic clock [s], shape
            (events,).
        read_s: Time at which the last bytes were received, on the computer's monotonic clock [s].
    """

    rows: NDArray[Any]
    events: NDArray[Any]
    arrival_s: NDArray[np.float64]
    event_arrival_s: NDArray[np.float64]
    read_s: float


class ForcePlate(Protocol):
    """An eight-channel force plate with its charge amplifier.

    Order of the calls: `connect`, `configure`, `operate`; then `start`, `read` repeatedly, `stop`.
    The order of the channels is that of `config.cell.plate`.
    """

    @abstractmethod
    def connect(self) -> str:
        """End a stream that is running; return maker, model and serial number of the device."""

    @abstractmethod
    def settings(self) -> tuple[PlateSetting, ...]:
        """Read every setting from the amplifier, without changing any."""

    @abstractmethod
    def configure(self) -> bool:
        """Change the settings that differ; return True if a change discharged the channels."""

    @abstractmethod
    def operate(self) -> None:
        """Start to measure: channels hold their charge; zero is the load at the last reset."""

    @abstractmethod
    def reset(self) -> None:
        """Discharge every channel and keep it at zero."""

    @abstractmethod
    def is_operating(self) -> bool:
        """Return True if the channels are measuring."""

    @abstractmethod
    def take_overloads(self) -> tuple[bool, ...]:
        """Return and clear a flag per channel, True after an overload since the last call."""

    @abstractmethod
    def forces_n(self) -> NDArray[np.float64]:
        """Return the present reading of the channels [N], shape (8,)."""

    @abstractmethod
    def start(self) -> None:
        """Start the stream of rows."""

    @abstractmethod
    def gather(self, until_s: float) -> bool:
        """Store incoming data until `until_s` [s, monotonic clock], for `read`.

        Return True if data arrived.
        """

    @abstractmethod
    def read(self, until_s: float) -> PlateRead:
        """Receive data as `gather` does, then return all data since the last call of `read`."""

    @abstractmethod
    def mark(self) -> float:
        """Request the amplifier's time in a stream; return the request's time [s, monotonic]."""

    @abstractmethod
    def forget_overloads(self) -> None:
        """Request the overloads during a stream, which clears the flags of past overloads."""

    @abstractmethod
    def stop(self, until_s: float) -> tuple[PlateRead, ...]:
        """End the stream; return the data that arrived before its end."""
