"""Modbus line that is silent, full of garbage, or cannot be opened: three different errors."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from config.cell.monitor import ModbusRtu, ModbusTcp, MonitorConfig
from config.errors import DeviceTimeoutError, ProtocolError, TransportError
from drivers.modbus.codec import RegisterRead
from drivers.modbus.link import open_modbus

READ = RegisterRead("holding", 10, 2, ())


@pytest.fixture
def line() -> Iterator[tuple[int, str]]:
    """Return the other end of a serial line, and the line's path."""
    other, own = os.openpty()
    yield other, os.ttyname(own)
    os.close(other)
    os.close(own)


def monitor(address: str) -> MonitorConfig:
    link = ModbusRtu(kind="rtu", address=address, baud_rate=115200, parity="none")
    return MonitorConfig(link=link, units=(1,), timeout_s=0.3)


def answering(other: int, answer: bytes) -> Callable[[], None]:
    """Start a thread that answers the first request with these bytes; return its method `join`."""

    def answer_one() -> None:
        os.read(other, 256)
        if answer:
            os.write(other, answer)

    thread = threading.Thread(target=answer_one, daemon=True)
    thread.start()
    return thread.join


@pytest.mark.parametrize(
    "garbage",
    [b"\xff\x00\x7f", b"\x01\x03\x04\x00\x01", bytes(64)],
    ids=["noise", "half an answer", "break"],
)
def test_garbage_is_distinguished_from_silence(line: tuple[int, str], garbage: bytes) -> None:
    wait = answering(line[0], garbage)
    with open_modbus(monitor(line[1])) as link, pytest.raises(ProtocolError) as caught:
        link.read(1, READ)
    wait()
    assert caught.value.refusal == "RID-MODBUS-GARBAGE"
    assert f"{len(garbage)} bytes" in str(caught.value)


def test_silence_after_garbage_is_reported_as_silence(line: tuple[int, str]) -> None:
    with open_modbus(monitor(line[1])) as link:
        wait = answering(line[0], b"\xff\xff")
        with pytest.raises(ProtocolError):
            link.read(1, READ)
        wait()
        wait = answering(line[0], b"")
        with pytest.raises(DeviceTimeoutError) as caught:
            link.read(1, READ)
        wait()
    assert caught.value.refusal == "RID-MODBUS-SILENT"


def test_a_setting_that_the_adapter_lacks_is_reported(line: tuple[int, str]) -> None:
    link = ModbusRtu(kind="rtu", address=line[1], parity="even")  # a pseudo-terminal has none
    with pytest.raises(TransportError) as caught:
        open_modbus(MonitorConfig(link=link, units=(1,)))
    assert os.strerror(22) in str(caught.value)


def test_a_line_that_cannot_be_opened_is_reported_with_the_systems_reason(tmp_path: Path) -> None:
    missing = tmp_path / "ttyUSB9"
    with pytest.raises(TransportError) as caught:
        open_modbus(monitor(str(missing)))
    assert caught.value.refusal == "RID-MODBUS-OPEN"
    assert os.strerror(2) in str(caught.value)
    link = ModbusTcp(kind="tcp", host="127.0.0.1", port=1)
    with pytest.raises(TransportError) as caught:
        open_modbus(MonitorConfig(link=link, units=(1,), timeout_s=0.3))
    assert os.strerror(111) in str(caught.value)
