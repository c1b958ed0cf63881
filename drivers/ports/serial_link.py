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
    """An open serial port, with deadlines as absolute times and errors of our own types.

    Attributes:
        address: Path or URL that was opened.
        clock: Clock to which all deadlines of this port refer.
        last_time_s: Time at which the last bytes were received, on `clock` [s].
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
            return  # a network port, which pyserial reads in its own threads
        self._poll = select.poll()
        self._poll.register(self._descriptor, select.POLLIN)

    @property
    def baud_rate(self) -> int:
        """Bits per second."""
        return int(self._port.baudrate)

    def set_baud_rate(self, baud_rate: int) -> None:
        """Change the baud rate; raise `TransportError` if the port does not support it."""
        try:
            self._port.baudrate = baud_rate
        except _PORT_ERRORS as error:
            raise self._lost(f"cannot be set to {baud_rate} baud", error) from error

    def write(self, data: bytes) -> None:
        """Send bytes; raise `TransportError` if the port does not accept them."""
        try:
            self._port.write(data)
        except _PORT_ERRORS as error:
            raise self._lost("sending failed", error) from error

    def read(self, until_s: float) -> bytes:
        """Wait for bytes and return all received ones; empty if none arrive until `until_s` [s].

        Bytes that are already waiting are returned even after the deadline.

        Raises:
            TransportError: The port is lost.
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
            raise OSError("the other side closed the connection")
        return data

    def _read_network(self, until_s: float) -> bytes:
        """Read from a port without a file descriptor, by repeated reads with a short timeout."""
        while True:
            data: bytes = self._port.read(max(1, self._port.in_waiting))
            if data or self.clock.now_s() >= until_s:
                return data

    def close(self) -> None:
        """Close the port; a lost port counts as closed."""
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
        network_socket.close()  # pyserial does not, if the other side closed it first


def open_serial(address: str, baud_rate: int) -> SerialLink:
    """Open a serial port (8N1) for exclusive use, by its path or a URL that pyserial supports.

    Raises:
        TransportError: The port does not exist, cannot be opened, or another program uses it.
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
            f"serial port {address} cannot be opened ({error}); check plate.amplifier.address, the"
            " adapter, your permissions, and that no other program uses the port",
            code="RID-SERIAL-OPEN",
        ) from error
    with contextlib.suppress(*_PORT_ERRORS, AttributeError, NotImplementedError):
        port.set_low_latency_mode(True)  # USB adapters otherwise delay bytes by 16 ms
    return SerialLink(port, address)
