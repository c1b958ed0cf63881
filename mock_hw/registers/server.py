"""`RegisterService`: Modbus server of the simulated drives' registers, over TCP or serial line.

It runs in a thread of the drives' process, and reads the robot's state from the snapshot of the
axes. In lock-step, the client can stop simulated time during a request; the robot then does not
move.
"""

from __future__ import annotations

import contextlib
import math
import os
import selectors
import socket
import ssl
import threading
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path

from config.cell.drive_profile import DriveProfile
from config.cell.monitor import ModbusTcp, MonitorConfig
from config.errors import TransportError
from config.simulation.faults import RegisterFault
from mock_hw.host.pty_port import PtyPort
from mock_hw.registers.registers import SimulatedRegisters

BITS_PER_BYTE = 11  # 1 start, 8 data, 1 parity or second stop, 1 stop
MOST_CONNECTIONS = 8
_READ_BYTES = 4096


@dataclass(frozen=True)
class ServerCertificates:
    """Certificate files of a TLS server.

    Attributes:
        certificate: Certificate of the server.
        key: Key of the certificate.
        client_ca: Certificate authority of the clients; if given, every client needs a certificate
            from it.
    """

    certificate: Path
    key: Path
    client_ca: Path | None = None


@dataclass(frozen=True)
class RegisterSettings:
    """Settings of the register service.

    Attributes:
        monitor: Monitor as in the cell file.
        profile: Register profile of the drives.
        path: Path at which the serial port is created, for a serial line.
        certificates: Certificate files, if the server uses TLS.
        faults: Faults of the registers.
    """

    monitor: MonitorConfig
    profile: DriveProfile
    path: Path
    certificates: ServerCertificates | None = None
    faults: tuple[RegisterFault, ...] = ()


class RegisterService:
    """Modbus server: a context manager, and a `SimulatedDevice` on the computer's clock.

    Args:
        registers: Registers of the drives.
        settings: Settings with address, profile and certificates.
        realtime: True if the transmission of bytes on a serial line takes time.

    Attributes:
        port: TCP port; 0 on a serial line.

    Raises:
        TransportError: The server cannot use the address.
    """

    def __init__(
        self, registers: SimulatedRegisters, settings: RegisterSettings, *, realtime: bool
    ) -> None:
        self._registers = registers
        self._selector = selectors.DefaultSelector()
        self._stop, self._stopper = os.pipe()
        self._selector.register(self._stop, selectors.EVENT_READ, None)
        self._stopped = threading.Event()
        self._listener: socket.socket | None = None
        self._line: PtyPort | None = None
        self._buffers: dict[socket.socket, bytearray] = {}
        self._line_buffer = bytearray()
        self._tls: ssl.SSLContext | None = None
        self._byte_s = 0.0
        self._due: deque[tuple[float, bytes]] = deque()
        self.port = 0
        link = settings.monitor.link
        try:
            if isinstance(link, ModbusTcp):
                self._listen(link, settings)
            else:
                self._line = PtyPort(settings.path, patient=not realtime)
                if realtime:
                    self._byte_s = BITS_PER_BYTE / link.baud_rate
        except (OSError, TransportError) as error:
            self.close()
            raise TransportError(
                f"cannot serve the drives' registers: {error}", code="RID-MOCK-REGISTERS"
            ) from None
        self._thread = threading.Thread(target=self._run, name="drive registers", daemon=True)
        self._thread.start()

    @property
    def next_s(self) -> float:
        """Time at which the transmission of the next answer ends [s, CLOCK_MONOTONIC]."""
        return self._due[0][0] if self._due else math.inf

    def advance(self, until_s: float) -> None:
        """Deliver the answers whose transmission has ended by `until_s` [s]."""
        while self._due and self._due[0][0] <= until_s:
            data = self._due.popleft()[1]
            if self._line is not None:
                self._line.write(data)

    def send_late_answers(self) -> None:
        """Send the answers that a fault has delayed on the serial line."""
        held, self._registers.held = self._registers.held, []
        for data in held:
            if self._line is not None:
                self._line.write(data)

    def close(self) -> None:
        """End the service; remove its port."""
        self._stopped.set()
        with contextlib.suppress(OSError):
            os.write(self._stopper, b"x")
        if hasattr(self, "_thread"):
            self._thread.join()
        for connection in self._buffers:
            connection.close()
        if self._listener is not None:
            self._listener.close()
        if self._line is not None:
            self._line.close()
        self._selector.close()
        for descriptor in (self._stop, self._stopper):
            with contextlib.suppress(OSError):
                os.close(descriptor)

    def __enter__(self) -> RegisterService:
        """Return the service itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the service."""
        self.close()

    def _listen(self, link: ModbusTcp, settings: RegisterSettings) -> None:
        if link.tls is not None:
            files = settings.certificates
            if files is None:
                raise TransportError(
                    "the server's certificate and key are missing, which TLS needs",
                    code="RID-MOCK-REGISTERS",
                )
            self._tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            self._tls.load_cert_chain(files.certificate, files.key)
            if files.client_ca is not None:
                self._tls.load_verify_locations(files.client_ca)
                self._tls.verify_mode = ssl.CERT_REQUIRED
        self._listener = socket.create_server((link.host, link.port))
        self.port = int(self._listener.getsockname()[1])
        self._selector.register(self._listener, selectors.EVENT_READ, self._accept)

    def _run(self) -> None:
        while not self._stopped.is_set():
            if self._line is not None:
                self._serve_line(self._line)
                continue
            for key, _ in self._selector.select():
                if key.data is not None:
                    key.data(key.fileobj)

    def _accept(self, listener: socket.socket) -> None:
        connection, _ = listener.accept()
        connection.settimeout(5.0)
        if len(self._buffers) >= MOST_CONNECTIONS:
            connection.close()
            return
        try:
            if self._tls is not None:
                connection = self._tls.wrap_socket(connection, server_side=True)
        except OSError:  # no TLS, or no valid certificate
            connection.close()
            return
        self._buffers[connection] = bytearray()
        self._selector.register(connection, selectors.EVENT_READ, self._serve)

    def _serve(self, connection: socket.socket) -> None:
        buffer = self._buffers[connection]
        try:
            data = connection.recv(_READ_BYTES)
            buffer += data
            for answer in self._registers.take_tcp(buffer):
                connection.sendall(answer)
        except (OSError, ValueError):
            data = b""
        if not data:
            self._selector.unregister(connection)
            del self._buffers[connection]
            connection.close()

    def _serve_line(self, line: PtyPort) -> None:
        """Wait for requests on the line, and send the answers that are due.

        If no program has the port open, discard requests and answers, and wait 5 ms.
        """
        if not line.has_listener:
            self._line_buffer.clear()
            self._due.clear()
            self._stopped.wait(0.005)
            return
        with selectors.DefaultSelector() as poll:
            poll.register(self._stop, selectors.EVENT_READ)
            poll.register(line.fileno(), selectors.EVENT_READ)
            left_s = self.next_s - time.monotonic()
            ready = poll.select(None if left_s == math.inf else max(0.0, left_s))
        if ready:
            data = line.read()
            self._line_buffer += data
            for answer in self._registers.take_rtu(self._line_buffer):
                begin_s = max(time.monotonic(), self._due[-1][0] if self._due else 0.0)
                takes_s = (len(data) + len(answer)) * self._byte_s
                self._due.append((begin_s + takes_s, answer))
        self.advance(time.monotonic())
