"""`SerialLink`: an open serial port, with deadlines and typed errors; `open_serial` opens one."""

from __future__ import annotations

import contextlib
import io
import os
import select
import socket
import termios

import serial

from config.errors import TransportError
from drivers.ports.clock import Clock, MonotonicClock

_READ_BYTES = 1 << 16
_WRITE_TIMEOUT_S = 1.0
_POLL_S = 0.02
_PORT_ERRORS = (OSError, ValueError, termios.error)  # serial.SerialException is an OSError


class SerialLink:
    """A serial port with typed errors, chunked reads and absolute deadlines.

    Attributes:
        address: What was opened.
        clock: The time that all deadlines of this link are in.
        last_time_s: When the last bytes were received, on `clock` [s].
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

        Raises:
            TransportError: The port is gone.
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
            f"serial port {self.address}: {what} ({error}); check the adapter and its cable",
            code="RID-SERIAL-LOST",
        )

    def __enter__(self) -> SerialLink:
        """Return the link itself."""
        return self

    def __exit__(self, *_: object) -> None:
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

    Raises:
        TransportError: There is no such port, it cannot be opened, or another program has it.
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
            " the adapter is plugged in, that you may use it, and that no other program has it",
            code="RID-SERIAL-OPEN",
        ) from error
    with contextlib.suppress(*_PORT_ERRORS, AttributeError, NotImplementedError):
        port.set_low_latency_mode(True)  # USB adapters otherwise hold bytes back for 16 ms
    return SerialLink(port, address)
