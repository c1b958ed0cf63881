"""Invalid Modbus answers always raise a typed error and never give a number."""

from __future__ import annotations

import random
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from config.cell.monitor import ModbusTcp, MonitorConfig
from config.errors import DeviceTimeoutError, DriverError
from drivers.modbus.codec import RegisterRead
from drivers.modbus.link import open_modbus
from tests.builders.raised_codes import raises_code

ANSWERS = 60
READ = RegisterRead("holding", 100, 2, ())


def answer(request: bytes, chance: random.Random) -> bytes:
    """Return garbage, an answer to another request, an incomplete answer, or an exception."""
    transaction, _, _, unit = struct.unpack_from(">HHHB", request)
    kind = chance.randrange(7)
    if kind == 0:
        return chance.randbytes(chance.randrange(1, 300))
    if kind == 1:
        return request  # an echo
    if kind == 2:  # a correct header without a body
        return struct.pack(">HHHBBB", transaction, 0, 200, unit, 3, 255)
    if kind == 3:  # more registers than requested
        return struct.pack(">HHHBBB", transaction, 0, 11, unit, 3, 8) + bytes(8)
    if kind == 4:  # another unit
        return struct.pack(">HHHBBB", transaction, 0, 7, unit ^ 5, 3, 4) + bytes(4)
    if kind == 5:  # another function
        return struct.pack(">HHHBBB", transaction, 0, 7, unit, 4, 4) + bytes(4)
    return struct.pack(">HHHBB", transaction, 0, 3, unit, 0x83) + chance.randbytes(1)


class WrongServer(threading.Thread):
    """Modbus server that never gives the requested answer."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._chance = random.Random(11)
        self.answers = 0

    def run(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            with connection:
                while request := self._hear(connection):
                    self.answers += 1
                    connection.sendall(answer(request, self._chance))

    def _hear(self, connection: socket.socket) -> bytes:
        try:
            return connection.recv(260)
        except OSError:
            return b""

    def close(self) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()


@pytest.fixture
def server() -> Iterator[WrongServer]:
    server = WrongServer()
    server.start()
    yield server
    server.close()


def test_no_wrong_answer_is_accepted(server: WrongServer) -> None:
    link = ModbusTcp(kind="tcp", host="127.0.0.1", port=server.port)
    config = MonitorConfig(link=link, units=(1,), timeout_s=0.05)
    with open_modbus(config, lambda _: None) as opened:
        for _ in range(ANSWERS):
            with pytest.raises(DriverError):
                opened.read(1, READ)
    assert server.answers > ANSWERS // 2


@pytest.mark.fault(31)
def test_a_silent_drive_costs_one_request_and_one_timeout(
    measured: Callable[[str], None],
) -> None:
    """The program only reads registers, never writes them, and sends each request once."""
    requests: list[bytes] = []
    waited_s = []
    with socket.create_server(("127.0.0.1", 0)) as server:
        link = ModbusTcp(kind="tcp", host="127.0.0.1", port=server.getsockname()[1])
        config = MonitorConfig(link=link, units=(1,), timeout_s=0.05)
        with open_modbus(config, lambda _: None) as opened:
            for _ in range(5):
                begun_s = time.monotonic()
                with raises_code(DeviceTimeoutError, "RID-MODBUS-SILENT", "0.05"):
                    opened.read(1, READ)
                waited_s.append(time.monotonic() - begun_s)
                connection, _ = server.accept()
                with connection:
                    requests.append(connection.recv(4096))
    assert [(len(request), request[7]) for request in requests] == [(12, 3)] * 5
    # the upper limit only excludes a retry; a busy computer stays below it
    assert 0.049 <= min(waited_s) < 5.0
    measured(
        f"a silent drive, timeout 50 ms: error after {1e3 * min(waited_s):.0f} ms and one request;"
        " no command writes registers, and a stop does not use Modbus"
    )
