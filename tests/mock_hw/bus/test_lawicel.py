"""Simulated slcan adapter with the commands of LAWICEL's CANUSB, used from a terminal and by
python-can.
"""

from __future__ import annotations

import os
import select
import termios
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from config.errors import TransportError
from mock_hw.bus.lawicel import AdapterFrame, LawicelAdapter
from mock_hw.bus.lawicel_port import LawicelPort
from tests.builders.raised_codes import raises_code

BITRATE = 1_000_000


@pytest.fixture
def adapter() -> LawicelAdapter:
    return LawicelAdapter(BITRATE, lambda: 60_000 + 0x1234)


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        (b"V\r", b"V1013\r"),
        (b"N\r", b"NA123\r"),
        (b"\r", b"\r"),
        (b"S8\r", b"\r"),
        (b"S9\r", b"\a"),
        (b"S8\rO\r", b"\r\r"),
        (b"O\r", b"\a"),  # no bit rate set
        (b"S8\rO\rO\r", b"\r\r\a"),
        (b"S8\rO\rS6\r", b"\r\r\a"),  # refused while the channel is open
        (b"S8\rO\rC\r", b"\r\r\r"),
        (b"C\r", b"\a"),
        (b"F\r", b"\a"),
        (b"S8\rO\rF\r", b"\r\rF00\r"),
        (b"s031C\rO\r", b"\r\r"),
        (b"sXYZ\r", b"\a"),
        (b"t1234\r", b"\a"),
        (b"S8\rO\rt20120F00\r", b"\r\rz\r"),
        (b"S8\rO\rT0000020120F00\r", b"\r\rZ\r"),
        (b"S8\rO\rt2012\r", b"\r\r\a"),  # fewer bytes than stated
        (b"S8\rO\rt2019\r", b"\r\r\a"),
        (b"S8\rO\rt8010\r", b"\r\r\a"),
        (b"S8\rL\rt2010\r", b"\r\r\a"),  # listen-only mode
        (b"M00000000\rmFFFFFFFF\rM0\r", b"\r\r\a"),
        (b"what\r", b"\a"),
    ],
)
def test_commands_and_answers(adapter: LawicelAdapter, command: bytes, answer: bytes) -> None:
    assert adapter.feed(command)[0] == answer
    other = LawicelAdapter(BITRATE, lambda: 0)
    assert b"".join(other.feed(command[i : i + 1])[0] for i in range(len(command))) == answer


def test_frames_are_decoded_and_encoded(adapter: LawicelAdapter) -> None:
    adapter.feed(b"S8\rO\r")
    _, frames = adapter.feed(b"t20120F00\rT1ABCDEF00\rr1234\r")
    assert frames == [
        AdapterFrame(0x201, 2, b"\x0f\x00"),
        AdapterFrame(0x9ABCDEF0, 0, b""),
        AdapterFrame(0x40000123, 4, b""),
    ]
    assert adapter.encode(AdapterFrame(0x181, 3, b"\x37\x06\xe8")) == b"t18133706E8\r"
    assert adapter.encode(AdapterFrame(0x9ABCDEF0, 0, b"")) == b"T1ABCDEF00\r"
    assert adapter.encode(AdapterFrame(0x40000123, 4, b"")) == b"r1234\r"
    adapter.feed(b"C\rZ1\rO\r")
    assert adapter.encode(AdapterFrame(0x080, 0, b"")) == b"t08001234\r"


def test_a_closed_adapter_or_another_bit_rate_transmits_nothing(
    adapter: LawicelAdapter,
) -> None:
    assert adapter.encode(AdapterFrame(0x181, 0, b"")) == b""
    adapter.feed(b"S6\rO\r")
    assert adapter.encode(AdapterFrame(0x181, 0, b"")) == b""
    assert adapter.feed(b"t2010\r") == (b"z\r", [])


def test_endless_garbage_needs_bounded_memory(adapter: LawicelAdapter) -> None:
    for _ in range(1000):
        assert adapter.feed(b"t" * 1000) == (b"", [])
    assert len(adapter._pending) < 100
    assert adapter.feed(b"\r") == (b"\a", [])


@pytest.fixture
def port(tmp_path: Path) -> Iterator[LawicelPort]:
    port = LawicelPort(tmp_path / "adapter", BITRATE)
    yield port
    port.shutdown()
    assert not (tmp_path / "adapter").is_symlink()


def test_a_plain_terminal_opens_the_channel_and_receives_frames(
    port: LawicelPort, tmp_path: Path
) -> None:
    terminal = os.open(tmp_path / "adapter", os.O_RDWR | os.O_NOCTTY)
    try:
        tty.setraw(terminal, termios.TCSANOW)
        os.write(terminal, b"S8\rO\rt20120F00\r")
        (frame,) = port.receive_frames(10.0) or ()
        assert (frame.cob_id, frame.data) == (0x201, b"\x0f\x00")
        port.send_frames([(0x181, b"\x37\x06"), (0x701, b"\x05")])
        assert output_of(terminal, 27) == b"\r\rz\rt18123706\rt701105\r"
    finally:
        os.close(terminal)


def output_of(terminal: int, count: int) -> bytes:
    text = b""
    until_s = time.monotonic() + 120.0
    while len(text) < count and time.monotonic() < until_s:
        if select.select([terminal], [], [], 0.1)[0]:
            text += os.read(terminal, count - len(text))
        elif text.count(b"\r") >= 5:
            break
    return text


def test_a_second_computer_does_not_receive_frames_left_by_the_first(
    port: LawicelPort, tmp_path: Path
) -> None:
    first = os.open(tmp_path / "adapter", os.O_RDWR | os.O_NOCTTY)
    os.write(first, b"S8\rO\r")
    port.receive_frames(10.0)
    port.send_frames([(0x181, bytes(8))] * 50)
    os.close(first)
    second = os.open(tmp_path / "adapter", os.O_RDWR | os.O_NOCTTY)
    try:
        os.write(second, b"C\r")
        port.receive_frames(10.0)
        assert output_of(second, 1) == b"\r"
    finally:
        os.close(second)


def test_python_cans_slcan_interface_works_with_it(port: LawicelPort, tmp_path: Path) -> None:
    with can.Bus(
        interface="slcan", channel=str(tmp_path / "adapter"), bitrate=BITRATE, sleep_after_open=0.0
    ) as bus:
        bus.send(can.Message(arbitration_id=0x201, data=b"\x0f\x00", is_extended_id=False))
        while not (arrived := [*(port.receive_frames(10.0) or ())]):
            pass  # so far only the commands that open the adapter have arrived
        assert [(frame.cob_id, frame.data) for frame in arrived] == [(0x201, b"\x0f\x00")]
        port.send_frames([(0x181, b"\x37\x06")])
        message = bus.recv(10.0)
        assert message is not None
        assert (message.arbitration_id, bytes(message.data)) == (0x181, b"\x37\x06")


def test_an_existing_path_is_refused(port: LawicelPort, tmp_path: Path) -> None:
    with raises_code(TransportError, "RID-SOCKET-PATH"):
        LawicelPort(tmp_path / "adapter", BITRATE)


@pytest.mark.parametrize("data_bytes", range(9))
def test_a_full_buffer_loses_whole_frames_only(tmp_path: Path, data_bytes: int) -> None:
    port = LawicelPort(tmp_path / "adapter", BITRATE)
    reader = os.open(tmp_path / "adapter", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        os.write(reader, b"S8\rO\r")
        port.receive_frames(1.0)
        frame = (0x123, bytes(range(0x10, 0x10 + data_bytes)))
        for _ in range(2000):
            port.send_frames([frame])
        lines = read_all(reader)
        port.send_frames([frame])
        lines += read_all(reader)
    finally:
        os.close(reader)
        port.shutdown()
    assert len(set(lines.split(b"\r")[2:-1])) == 1
    assert lines.endswith(b"\r")


def test_a_line_that_the_kernel_takes_in_parts_is_not_damaged(
    port: LawicelPort, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reader = os.open(tmp_path / "adapter", os.O_RDWR | os.O_NOCTTY)
    write, accepted = os.write, iter([None, 5, None, 3, 100])

    def write_part(descriptor: int, data: bytes) -> int:
        count = next(accepted)
        if count is None:
            raise BlockingIOError
        return write(descriptor, data[:count])

    try:
        os.write(reader, b"S8\rO\r")
        port.receive_frames(10.0)
        assert output_of(reader, 2) == b"\r\r"
        with monkeypatch.context() as patch:
            patch.setattr(os, "write", write_part)
            for number in range(3):
                port.send_frames([(0x181, bytes([number]))])
            port.receive_frames(0.0)
            port.receive_frames(0.0)
        assert output_of(reader, 24) == b"t181100\rt181101\rt181102\r"
    finally:
        os.close(reader)


def read_all(terminal: int) -> bytes:
    """Return the bytes that the adapter has sent to the terminal and that were not read yet."""
    found = b""
    while select.select([terminal], [], [], 0.1)[0]:
        found += os.read(terminal, 1 << 16)
    return found
