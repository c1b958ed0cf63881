"""The one place that opens ports: `CanLink` over python-can, `SerialLink`, and their `Clock`."""

from __future__ import annotations

import contextlib
import io
import os
import select
import socket
import termios
import time
from abc import abstractmethod
from types import TracebackType
from typing import Any, Protocol

import can
import serial

from config.cell import CanBusConfig
from config.errors import TransportError
from drivers.canopen.frames import Frame

_RECEIVE_BUFFER_BYTES = 4 << 20
_BUS_OFF = 0x40
_READ_BYTES = 1 << 16
_WRITE_TIMEOUT_S = 1.0
_POLL_S = 0.02
_PORT_ERRORS = (OSError, ValueError, termios.error)  # serial.SerialException is an OSError


class Clock(Protocol):
    """Time as the cell has it: the computer's, or a simulated cell's in lock-step."""

    @abstractmethod
    def now_s(self) -> float:
        """Return the time since an arbitrary start [s]; never runs backwards."""

    @abstractmethod
    def sleep_until(self, time_s: float) -> None:
        """Return not before `time_s`, an absolute time of this clock [s]."""


class MonotonicClock:
    """The computer's monotonic clock, untouched by changes of the date."""

    def now_s(self) -> float:
        """Return CLOCK_MONOTONIC [s]."""
        return time.monotonic()

    def sleep_until(self, time_s: float) -> None:
        """Sleep to an absolute deadline; returns at once when it has passed."""
        while (remaining_s := time_s - time.monotonic()) > 0.0:
            time.sleep(remaining_s)


class _SimulatedClock:
    """A simulated bus's clock, with typed errors."""

    def __init__(self, clock: Clock, bus: can.BusABC) -> None:
        self._clock = clock
        self._bus = bus
        self.now_s = clock.now_s

    def sleep_until(self, time_s: float) -> None:
        """Let simulated time run; raises `TransportError` when the simulation is gone."""
        try:
            self._clock.sleep_until(time_s)
        except (can.CanError, OSError) as error:
            raise TransportError(
                f"CAN bus {self._bus.channel_info}: the simulated time stopped ({error})"
            ) from error


class CanLink:
    """A python-can bus with typed errors, absolute receive deadlines and its clock.

    A bus whose attribute `simulated_clock` is not None brings its own time; its receive timeouts
    and its messages' time stamps are then in that time.

    Attributes
    ----------
    clock
        The time that all deadlines of this link are in.
    simulated
        Whether that is a simulated clock.
    hears_itself
        Whether the bus brings back what is sent on it, as UDP multicast does.
    last_time_s
        When the last received frame arrived, on `clock` [s].
    """

    def __init__(self, bus: can.BusABC, *, hears_itself: bool = False) -> None:
        self._bus = bus
        self.hears_itself = hears_itself
        simulated_clock: Clock | None = getattr(bus, "simulated_clock", None)
        self.simulated = simulated_clock is not None
        self.clock: Clock = (
            MonotonicClock() if simulated_clock is None else _SimulatedClock(simulated_clock, bus)
        )
        self.last_time_s = self.clock.now_s()

    def send(self, frame: Frame) -> None:
        """Send a frame; raises `TransportError` when the bus does not take it."""
        self.send_message(
            can.Message(arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False)
        )

    def send_message(self, message: can.Message) -> None:
        """Send a python-can message that the caller reuses: the cyclic path."""
        try:
            self._bus.send(message)
        except (can.CanError, OSError) as error:
            raise TransportError(
                f"CAN bus {self._bus.channel_info}: sending failed ({error});"
                " check the adapter, its cable and the bus termination"
            ) from error

    def receive_message(self, until_s: float) -> can.Message | None:
        """Return the next classic data frame, or None when `until_s` [s] comes first.

        A deadline that has passed still takes what is waiting, without waiting.

        Raises
        ------
        TransportError
            The adapter is gone, or reports bus-off.
        """
        while True:
            timeout_s = until_s - self.clock.now_s()
            try:
                message = self._bus.recv(timeout_s if timeout_s > 0.0 else 0.0)
            except (can.CanError, OSError, ValueError) as error:
                raise TransportError(
                    f"CAN bus {self._bus.channel_info}: receiving failed ({error});"
                    " check the adapter and its cable"
                ) from error
            if message is None:
                return None
            self.last_time_s = message.timestamp if self.simulated else self.clock.now_s()
            if message.is_error_frame:
                if message.arbitration_id & _BUS_OFF:
                    raise TransportError(
                        f"CAN bus {self._bus.channel_info}: the adapter is bus-off;"
                        " check bit rate, cable and termination, then restart the interface"
                    )
            elif not (message.is_extended_id or message.is_remote_frame or message.is_fd):
                return message

    def receive(self, until_s: float) -> Frame | None:
        """Return the next frame, or None when `until_s` [s] comes first (`receive_message`)."""
        message = self.receive_message(until_s)
        return None if message is None else Frame(message.arbitration_id, bytes(message.data))

    def close(self) -> None:
        """Close the bus; raises `TransportError` when even that fails."""
        try:
            self._bus.shutdown()
        except (can.CanError, OSError) as error:
            raise TransportError(
                f"CAN bus {self._bus.channel_info}: closing failed ({error})"
            ) from error

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


def open_can(config: CanBusConfig) -> CanLink:
    """Open the bus that a cell file names.

    Raises
    ------
    TransportError
        The interface is unknown, its driver is missing or the channel cannot be opened.
    """
    options: dict[str, Any] = {"participant": True} if config.interface == "rid_sim" else {}
    try:
        bus = can.Bus(
            interface=config.interface,
            channel=config.channel,
            bitrate=config.bitrate,
            ignore_config=True,
            **options,
        )
    except (
        can.CanError,
        OSError,
        ValueError,
        TypeError,
        ImportError,
        NotImplementedError,
    ) as error:
        raise TransportError(
            f"CAN bus {config.interface}:{config.channel} cannot be opened ({error});"
            " check can.interface and can.channel in the cell file, and that the adapter is"
            " plugged in and up"
        ) from error
    if config.interface == "socketcan":
        _widen_receive_buffer(bus)
    return CanLink(bus, hears_itself=config.interface == "udp_multicast")


def _widen_receive_buffer(bus: can.BusABC) -> None:
    """Give SocketCAN room: its default holds 35 ms of a full bus and drops the rest silently."""
    bus_socket = getattr(bus, "socket", None)
    if isinstance(bus_socket, socket.socket):
        bus_socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)


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
        with contextlib.suppress(*_PORT_ERRORS):
            self._port.close()

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
            write_timeout=_WRITE_TIMEOUT_S,
        )
        port.exclusive = True
        port.open()
    except (*_PORT_ERRORS, ImportError) as error:
        raise TransportError(
            f"serial port {address} cannot be opened ({error}); check plate.amplifier.address, that"
            " the adapter is plugged in, that you may use it, and that no other program has it"
        ) from error
    with contextlib.suppress(*_PORT_ERRORS, AttributeError, NotImplementedError):
        port.set_low_latency_mode(True)  # USB adapters otherwise hold bytes back for 16 ms
    return SerialLink(port, address)
