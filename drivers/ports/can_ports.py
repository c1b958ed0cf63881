"""`FramePort`: interface of every CAN bus; `PythonCanPort`: implementation with python-can.

SocketCAN (`drivers.ports.socketcan_port`) and the simulated bus implement `FramePort` without
python-can: batches of plain tuples need a tenth of the computing time of python-can's messages.
"""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Sequence
from typing import NamedTuple, Protocol, runtime_checkable

from config.errors import TransportError
from drivers.canopen.frames import REMOTE_FLAG
from drivers.ports.python_can import can

BUS_OFF = 0x040
RESTARTED = 0x100


class Arrival(NamedTuple):
    """A classic data frame with an 11-bit identifier, and its arrival time on the link's clock [s].

    If the bus does not provide arrival times, the time of reading is used.
    """

    cob_id: int
    data: bytes
    time_s: float


@runtime_checkable
class FramePort(Protocol):
    """An open CAN bus; its methods raise `can.CanError`, `OSError` or `TransportError`.

    Attributes:
        channel_info: Name of the bus in messages.
        time_stamped: True if the bus provides the arrival time of each frame in real time; the time
            does then not depend on when the frame is read.
    """

    channel_info: str
    time_stamped: bool

    @abstractmethod
    def send_frames(self, frames: Sequence[tuple[int, bytes | bytearray]]) -> None:
        """Send frames (identifier and data) in this order.

        Try to send every frame; at the end, raise the first error.
        """

    @abstractmethod
    def receive_frames(self, timeout_s: float) -> Sequence[Arrival] | None:
        """Return the frames that have arrived; None if none arrives within `timeout_s` [s].

        The sequence is empty if only other kinds of frames arrived, such as error frames.
        """

    @abstractmethod
    def shutdown(self) -> None:
        """Close the bus."""


class PythonCanPort:
    """A bus of python-can as a `FramePort`.

    Args:
        bus: The open bus.
        simulated: True if the time stamps of the bus's messages are in simulated time, which is
            then also the link's time.

    Attributes:
        takes_remote_frames: True to return remote frames too, marked by `REMOTE_FLAG`; simulated
            devices need them.
    """

    def __init__(self, bus: can.BusABC, *, simulated: bool) -> None:
        self._bus = bus
        self._simulated = simulated
        self.channel_info = bus.channel_info
        self.time_stamped = False
        self.takes_remote_frames = False
        self.shutdown = bus.shutdown

    def send_frames(self, frames: Sequence[tuple[int, bytes | bytearray]]) -> None:
        """Send frames; see `FramePort`."""
        failed: Exception | None = None
        for cob_id, data in frames:
            message = _message(cob_id, data)
            try:
                self._bus.send(message)
            except (can.CanError, OSError) as error:
                failed = failed or error
        if failed is not None:
            raise failed

    def receive_frames(self, timeout_s: float) -> Sequence[Arrival] | None:
        """Return the next frame; see `FramePort`."""
        message = self._bus.recv(timeout_s)
        if message is None:
            return None
        if message.is_error_frame:
            refuse_bus_off(message.arbitration_id, self.channel_info)
            return ()
        remote = message.is_remote_frame
        if message.is_extended_id or message.is_fd or (remote and not self.takes_remote_frames):
            return ()
        time_s = message.timestamp if self._simulated else time.monotonic()
        if remote:
            return (Arrival(REMOTE_FLAG | message.arbitration_id, bytes(message.dlc), time_s),)
        return (Arrival(message.arbitration_id, bytes(message.data), time_s),)


def _message(cob_id: int, data: bytes | bytearray) -> can.Message:
    if cob_id & REMOTE_FLAG:
        return can.Message(
            arbitration_id=cob_id & ~REMOTE_FLAG,
            is_remote_frame=True,
            dlc=len(data),
            is_extended_id=False,
        )
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False)


def refuse_bus_off(error_class: int, channel: str) -> None:
    """Raise `TransportError` if an error frame reports bus-off, or a restart after bus-off."""
    if error_class & BUS_OFF:
        raise TransportError(
            f"CAN bus {channel}: the adapter is bus-off;"
            " check bit rate, cable and termination, then restart the interface",
            code="RID-CAN-BUS-OFF",
        )
    if error_class & RESTARTED:
        raise TransportError(
            f"CAN bus {channel}: the adapter was bus-off and has restarted by itself; check bit"
            " rate, cable and termination, and set restart-ms 0, so that a person restarts it",
            code="RID-CAN-BUS-OFF",
        )
