"""The one place that opens ports: `CanLink` over python-can, and `SerialLink`."""

from __future__ import annotations

import contextlib
import io
import os
import select
import socket
import termios
from collections import Counter, deque
from collections.abc import Callable, Sequence
from types import TracebackType

import serial

from config.cell.cell import CanBusConfig
from config.errors import TransportError
from drivers.canopen.frames import Frame
from drivers.ports.can_ports import Arrival, FramePort, PythonCanPort
from drivers.ports.clock import Clock, MonotonicClock, SimulatedClock
from drivers.ports.python_can import can
from drivers.ports.python_can_bus import not_opened, open_bus
from drivers.ports.socketcan_port import SocketCanPort

_READ_BYTES = 1 << 16
_WRITE_TIMEOUT_S = 1.0
_POLL_S = 0.02
_PORT_ERRORS = (OSError, ValueError, termios.error)  # serial.SerialException is an OSError


class CanLink:
    """A CAN bus with typed errors, absolute receive deadlines and its clock.

    A bus whose attribute `simulated_clock` is not None brings its own time; its receive timeouts
    and its frames' times are then in that time.

    A bus that brings back what is sent on it, as UDP multicast does, `hears_itself`: as many frames
    as were sent are left out when they come back, so that a frame of the same identifier that
    somebody else sent is told from them.

    Attributes
    ----------
    clock
        The time that all deadlines of this link are in.
    simulated
        Whether that is a simulated clock.
    time_stamped
        Whether the bus says when a frame arrived; otherwise that is when it was read.
    last_time_s
        When the last received frame arrived, on `clock` [s].
    """

    def __init__(self, bus: can.BusABC | FramePort, *, hears_itself: bool = False) -> None:
        simulated_clock: Clock | None = getattr(bus, "simulated_clock", None)
        self.simulated = simulated_clock is not None
        self._port: FramePort
        if isinstance(bus, FramePort):
            self._port = bus
        else:
            self._port = PythonCanPort(bus, simulated=self.simulated)
        self._name = bus.channel_info
        self._descriptor: Callable[[], int] | None = getattr(bus, "fileno", None)
        self.clock: Clock = (
            MonotonicClock()
            if simulated_clock is None
            else SimulatedClock(simulated_clock, self._name)
        )
        self.time_stamped = self._port.time_stamped
        self.last_time_s = self.clock.now_s()
        self._arrived: deque[Arrival] = deque()
        self._echoes: Counter[tuple[int, bytes]] | None = Counter() if hears_itself else None

    @property
    def lost_frames(self) -> int:
        """How many frames the computer had to drop, as far as the bus counts them."""
        return int(getattr(self._port, "lost_frames", 0))

    def fileno(self) -> int:
        """Return a descriptor to wait at, -1 where there is none."""
        try:
            return -1 if self._descriptor is None else self._descriptor()
        except NotImplementedError:
            return -1

    def send(self, frame: Frame) -> None:
        """Send a frame; raises `TransportError` when the bus does not take it."""
        self.send_frames((frame,))

    def send_frames(self, frames: Sequence[tuple[int, bytes | bytearray]]) -> None:
        """Send frames (identifier and data), oldest first; every one is tried.

        Raises
        ------
        TransportError
            The bus did not take one of them.
        """
        if self._echoes is not None:
            self._echoes.update((cob_id, bytes(data)) for cob_id, data in frames)
        try:
            self._port.send_frames(frames)
        except (can.CanError, OSError) as error:
            raise TransportError(
                f"CAN bus {self._name}: sending failed ({error});"
                " check the adapter, its cable and the bus termination"
            ) from error

    def receive(self, until_s: float) -> Frame | None:
        """Return the next classic data frame, or None when `until_s` [s] comes first.

        A deadline that has passed still takes what is waiting, without waiting.

        Raises
        ------
        TransportError
            The adapter is gone, or reports bus-off.
        """
        if not self._arrived:
            self._arrived.extend(self.receive_all(until_s))
        if not self._arrived:
            return None
        cob_id, data, self.last_time_s = self._arrived.popleft()
        return Frame(cob_id, data)

    def receive_all(self, until_s: float) -> Sequence[Arrival]:
        """Return all classic data frames that have come, oldest first.

        Waits for one as `receive` does; empty when `until_s` [s] comes first.
        """
        if self._arrived:
            arrived = (*self._arrived,)
            self._arrived.clear()
            return arrived
        while True:
            timeout_s = until_s - self.clock.now_s()
            try:
                frames = self._port.receive_frames(timeout_s if timeout_s > 0.0 else 0.0)
            except (can.CanError, OSError, ValueError) as error:
                raise TransportError(
                    f"CAN bus {self._name}: receiving failed ({error});"
                    " check the adapter and its cable"
                ) from error
            if frames is None:
                return ()
            if self._echoes is not None:
                frames = [frame for frame in frames if not self._is_echo(frame[:2])]
            if frames:
                return frames

    def _is_echo(self, frame: tuple[int, bytes]) -> bool:
        """Return whether a frame is one that was sent here and has come back."""
        echoes = self._echoes
        assert echoes is not None
        count = echoes[frame]
        if count > 1:
            echoes[frame] = count - 1
        else:
            del echoes[frame]
        return count > 0

    def close(self) -> None:
        """Close the bus; raises `TransportError` when even that fails."""
        try:
            self._port.shutdown()
        except (can.CanError, OSError) as error:
            raise TransportError(f"CAN bus {self._name}: closing failed ({error})") from error

    def __enter__(self) -> CanLink:
        """Return the link itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the bus."""
        self.close()


def open_can(config: CanBusConfig, *, watch_errors: bool = True) -> CanLink:
    """Open the bus that a cell file names; SocketCAN as a raw socket, past python-can.

    Parameters
    ----------
    config
        Interface, channel and bit rate.
    watch_errors
        Whether bus-off that a SocketCAN interface reports is an error.

    Raises
    ------
    ConfigError
        The interface is unknown.
    TransportError
        Its driver is missing or the channel cannot be opened.
    """
    bus: can.BusABC | FramePort
    if config.interface != "socketcan":
        bus = open_bus(config)
    else:
        try:
            bus = SocketCanPort(config.channel, watch_errors=watch_errors)
        except (OSError, ValueError) as error:
            raise not_opened(config, error) from error
    return CanLink(bus, hears_itself=config.interface == "udp_multicast")


class SerialLink:
    """A serial port with typed errors, chunked reads and absolute deadlines.

    Attributes
    ----------
    address
        What was opened.
    clock
        The time that all deadlines of this link are in.
    last_time_s
        When the last bytes were received, on `clock` [s].
    """

    def __init__(self, port: serial.Serial, address: str) -> None:
        self._port = port
        self.address = address
        self.clock: Clock = MonotonicClock()
        self.last_time_s = self.clock.now_s()
        self._poll: select.poll | None = None
        try:
            self._descriptor = port.fileno()
        except (AttributeError, io.UnsupportedOperation):
            return  # a port over the network that has threads of its own
        self._poll = select.poll()
        self._poll.register(self._descriptor, select.POLLIN)

    @property
    def baud_rate(self) -> int:
        """Bits per second."""
        return int(self._port.baudrate)

    def set_baud_rate(self, baud_rate: int) -> None:
        """Change the line's speed; raises `TransportError` when the port cannot."""
        try:
            self._port.baudrate = baud_rate
        except _PORT_ERRORS as error:
            raise self._lost(f"cannot be set to {baud_rate} baud", error) from error

    def write(self, data: bytes) -> None:
        """Send bytes; raises `TransportError` when the port does not take them."""
        try:
            self._port.write(data)
        except _PORT_ERRORS as error:
            raise self._lost("sending failed", error) from error

    def read(self, until_s: float) -> bytes:
        """Return all that is waiting, at least a byte; nothing when `until_s` [s] comes first.

        A deadline that has passed still takes what is waiting, without waiting.

        Raises
        ------
        TransportError
            The port is gone.
        """
        try:
            data = self._read_network(until_s) if self._poll is None else self._read(until_s)
        except _PORT_ERRORS as error:
            raise self._lost("receiving failed", error) from error
        if data:
            self.last_time_s = self.clock.now_s()
        return data

    def _read(self, until_s: float) -> bytes:
        assert self._poll is not None
        remaining_ms = max(until_s - self.clock.now_s(), 0.0) * 1000.0
        if not self._poll.poll(remaining_ms):
            return b""
        data = os.read(self._descriptor, _READ_BYTES)
        if not data:
            raise OSError("it hung up")
        return data

    def _read_network(self, until_s: float) -> bytes:
        """Read a port without a descriptor, whose time-out is fixed and short."""
        while True:
            data: bytes = self._port.read(max(1, self._port.in_waiting))
            if data or self.clock.now_s() >= until_s:
                return data

    def close(self) -> None:
        """Close the port; one that is gone is closed already."""
        _close_port(self._port)

    def _lost(self, what: str, error: Exception) -> TransportError:
        return TransportError(
            f"serial port {self.address}: {what} ({error}); check the adapter and its cable"
        )

    def __enter__(self) -> SerialLink:
        """Return the link itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the port."""
        self.close()


def _close_port(port: serial.Serial) -> None:
    network_socket = getattr(port, "_socket", None)
    with contextlib.suppress(*_PORT_ERRORS):
        port.close()
    if isinstance(network_socket, socket.socket):
        network_socket.close()  # pyserial forgets it where the other side has gone first


def open_serial(address: str, baud_rate: int) -> SerialLink:
    """Open a serial port, 8N1, for this process alone: a path, or a URL that pyserial knows.

    Raises
    ------
    TransportError
        There is no such port, it cannot be opened, or another program has it.
    """
    try:
        port = serial.serial_for_url(
            address,
            do_not_open=True,
            baudrate=baud_rate,
            timeout=_POLL_S,
            write_timeout=None if "://" in address else _WRITE_TIMEOUT_S,  # RFC 2217 has none
        )
        port.exclusive = True
        try:
            port.open()
        except BaseException:
            _close_port(port)
            raise
    except (*_PORT_ERRORS, ImportError, NotImplementedError) as error:
        raise TransportError(
            f"serial port {address} cannot be opened ({error}); check plate.amplifier.address, that"
            " the adapter is plugged in, that you may use it, and that no other program has it"
        ) from error
    with contextlib.suppress(*_PORT_ERRORS, AttributeError, NotImplementedError):
        port.set_low_latency_mode(True)  # USB adapters otherwise hold bytes back for 16 ms
    return SerialLink(port, address)
