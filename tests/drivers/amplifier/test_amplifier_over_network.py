"""Amplifier behind a device server: RFC 2217 and raw TCP, by pyserial's server side."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import serial
import serial.rfc2217

from config.errors import TransportError
from drivers.amplifier.amplifier import open_amplifier
from tests.builders.raised_codes import raises_code

Serve = Callable[..., Any]
pytestmark = pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")  # pyserial's


class PlainPort(serial.Serial):
    """Serial port without modem lines, which a pseudo-terminal lacks."""

    dtr = rts = break_condition = property(lambda self: False, lambda self, value: None)
    cts = dsr = ri = cd = property(lambda self: False)


class DeviceServer:
    """Passes bytes between one TCP connection and a serial port, until it is closed."""

    def __init__(self, path: str, *, telnet: bool) -> None:
        self._port = PlainPort(path, 460800, timeout=0)
        self._telnet = telnet
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._wake, self._woken = os.pipe()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        os.write(self._woken, b"x")
        self._thread.join(120.0)
        self._listener.close()
        self._port.close()
        os.close(self._wake)
        os.close(self._woken)

    def _run(self) -> None:
        watched: list[socket.socket | int] = [self._listener, self._wake]
        if self._wake in select.select(watched, [], [])[0]:
            return
        connection, _ = self._listener.accept()
        with connection:
            self._pass(connection)

    def _pass(self, connection: socket.socket) -> None:
        manager = None
        if self._telnet:
            peer = type("Peer", (), {"write": staticmethod(connection.sendall)})()
            manager = serial.rfc2217.PortManager(self._port, peer)  # type: ignore[arg-type] # stub: a client
        watched: list[socket.socket | serial.Serial | int] = [connection, self._port, self._wake]
        while True:
            ready, _, _ = select.select(watched, [], [])
            if self._wake in ready:
                return
            if self._port in ready:
                data = self._port.read(4096)
                out = b"".join(manager.escape(data)) if manager else data
                connection.sendall(out)
            if connection in ready:
                data = connection.recv(4096)
                if not data:
                    return
                self._port.write(b"".join(manager.filter(data)) if manager else data)


@pytest.fixture
def amplifier_behind_server(
    serve_amplifier: Serve,
) -> Iterator[Callable[[str], tuple[Any, DeviceServer]]]:
    servers: list[DeviceServer] = []

    def serve(scheme: str) -> tuple[Any, DeviceServer]:
        served = serve_amplifier()
        server = DeviceServer(served.address, telnet=scheme == "rfc2217")
        servers.append(server)
        address = f"{scheme}://127.0.0.1:{server.port}"
        amplifier = served.plate.amplifier.model_copy(update={"address": address})
        served.plate = served.plate.model_copy(update={"amplifier": amplifier})
        return served, server

    yield serve
    for server in servers:
        with contextlib.suppress(OSError):
            server.close()


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.amplifier.dialogue.ANSWER_TIMEOUT_S", 20.0)
    monkeypatch.setattr("drivers.amplifier.dialogue.BAUD_RATES", ())


@pytest.mark.parametrize("scheme", ["rfc2217", "socket"])
def test_settings_and_rows_are_read_over_the_network(
    amplifier_behind_server: Callable[[str], tuple[Any, DeviceServer]], scheme: str
) -> None:
    served, _ = amplifier_behind_server(scheme)
    until_s = time.monotonic() + 120.0
    with open_amplifier(served.plate.amplifier, served.profile) as amplifier:
        assert amplifier.connect().startswith("rid-daq,simulated")
        amplifier.configure()
        amplifier.operate()
        amplifier.start()
        sequences: list[int] = []
        while len(sequences) < 1000:
            assert time.monotonic() < until_s
            sequences += amplifier.read(until_s).rows["sequence"].tolist()
        amplifier.stop(until_s)
        assert sequences == list(range(1000))
        assert amplifier.stream_counts.garbage_bytes == 0


@pytest.mark.parametrize("scheme", ["rfc2217", "socket"])
def test_a_lost_device_server_is_an_error_of_the_line(
    amplifier_behind_server: Callable[[str], tuple[Any, DeviceServer]], scheme: str
) -> None:
    served, server = amplifier_behind_server(scheme)
    until_s = time.monotonic() + 120.0
    with open_amplifier(served.plate.amplifier, served.profile) as amplifier:
        amplifier.connect()
        amplifier.operate()
        amplifier.start()
        amplifier.read(until_s)
        server.close()
        with raises_code(TransportError, "RID-SERIAL-LOST"):
            read_on(amplifier, until_s)


def read_on(amplifier: Any, until_s: float) -> None:
    while time.monotonic() < until_s:
        amplifier.read(until_s)
