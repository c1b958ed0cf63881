"""`ForcePlate`: an eight-channel force plate with its charge amplifier.

To add an amplifier, write a class with the methods of `ForcePlate`: settings are read back and told
as `PlateSetting`, the stream is handed over in pieces as `PlateRead`. Anything that goes wrong on
the line is a `config.errors.DriverError` (`TransportError` where the line is gone: the recorder
then waits for it to come back). `drivers.amplifier.amplifier.SerialAmplifier` is one.
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
        name: What it is, in words.
        channel: 1 to 8; 0 for what belongs to all.
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
    """What one read of a force plate's stream brought.

    Attributes:
        rows: `drivers.amplifier.frames.PLATE_ROW`, in the order sent.
        events: `drivers.amplifier.frames.PLATE_EVENT`, in the order sent.
        arrival_s: When each row was here, on the cell's clock [s], shape (rows,); rows that one
            piece brought arrived together.
        event_arrival_s: When each event was here, on the computer's monotonic clock [s], shape
            (events,).
        read_s: When the last piece was here, on the computer's monotonic clock [s].
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
