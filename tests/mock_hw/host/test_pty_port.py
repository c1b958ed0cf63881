"""Pseudo-terminal from the side of a device."""

from __future__ import annotations

import os
import termios
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest
import serial

from config.errors import TransportError
from mock_hw.host.pty_port import UNKNOWN_RATE, PtyPort
from tests.builders.raised_codes import raises_code


@pytest.fixture
def port(tmp_path: Path) -> Iterator[PtyPort]:
    port = PtyPort(tmp_path / "amplifier", patient=False)
    yield port
    port.close()


def open_raw(path: Path) -> int:
    return os.open(path, os.O_RDWR | os.O_NOCTTY)


def test_bytes_are_transmitted_in_both_directions_without_echo(
    port: PtyPort, tmp_path: Path
) -> None:
    computer = open_raw(tmp_path / "amplifier")
    os.write(computer, b"ID?\r")
    assert port.read() == b"ID?\r"
    assert port.read() == b""
    port.write(bytes(range(256)))
    assert os.read(computer, 1000) == bytes(range(256))
    os.close(computer)


def test_the_port_detects_a_listener(port: PtyPort, tmp_path: Path) -> None:
    alone = port.has_listener
    port.write(b"said to nobody")
    computer = open_raw(tmp_path / "amplifier")
    assert (alone, port.has_listener) == (False, True)
    os.set_blocking(computer, False)
    with pytest.raises(BlockingIOError):
        os.read(computer, 10)
    os.close(computer)
    assert not port.has_listener
    assert port.read() == b""
    assert port.lost_bytes == 0


def test_the_port_detects_the_baud_rate_set_by_the_computer(port: PtyPort, tmp_path: Path) -> None:
    for rate in (460800, 9600):
        with serial.Serial(str(tmp_path / "amplifier"), rate):
            assert port.baud_rate == rate
    port.unplug()
    assert port.baud_rate == UNKNOWN_RATE


def test_a_computer_that_does_not_read_loses_bytes(port: PtyPort, tmp_path: Path) -> None:
    computer = open_raw(tmp_path / "amplifier")
    for _ in range(1000):
        port.write(bytes(1000))
    assert port.lost_bytes > 500_000
    os.close(computer)


def test_an_unplugged_port_hangs_up_and_returns_at_the_same_path(
    port: PtyPort, tmp_path: Path
) -> None:
    computer = open_raw(tmp_path / "amplifier")
    port.unplug()
    port.unplug()
    assert os.read(computer, 10) == b""
    assert not (tmp_path / "amplifier").exists()
    assert port.fileno() == -1
    assert port.read() == b""
    port.write(b"into the void")
    os.close(computer)
    port.plug()
    port.plug()
    again = open_raw(tmp_path / "amplifier")
    tty.setraw(again, termios.TCSANOW)
    port.write(b"here")
    assert os.read(again, 10) == b"here"
    os.close(again)


def test_a_port_at_an_existing_path_is_refused(port: PtyPort, tmp_path: Path) -> None:
    with raises_code(TransportError, "RID-SOCKET-PATH"):
        PtyPort(tmp_path / "amplifier", patient=False)
    assert (tmp_path / "amplifier").is_symlink()
