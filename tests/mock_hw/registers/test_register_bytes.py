"""Simulated registers, compared byte by byte with examples of the specifications.

No port is opened.
"""

from __future__ import annotations

import struct

import pytest

from mock_hw.registers.registers import SimulatedRegisters, crc16


def test_the_checksum_is_that_of_the_specification() -> None:
    """Modbus over serial line 1.02, 6.2.2: the CRC of the bytes 02 07 is sent as 41 12."""
    assert crc16(b"\x02\x07") == 0x1241
    assert crc16(b"\x02\x07\x41\x12") == 0


def test_holding_registers_are_read_as_in_the_specification() -> None:
    """Application protocol 1.1b3, 6.3: registers 107 to 109 hold 022B, 0, 64."""
    drive = SimulatedRegisters(lambda unit: {107: 0x022B, 108: 0, 109: 0x0064})
    request = bytearray(b"\x00\x01\x00\x00\x00\x06\x11\x03\x00\x6b\x00\x03")
    assert drive.take_tcp(request) == [
        b"\x00\x01\x00\x00\x00\x09\x11\x03\x06\x02\x2b\x00\x00\x00\x64"
    ]
    assert not request


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        (b"\x03\x00\x6b\x00\x00", b"\x83\x03"),
        (b"\x03\x00\x6b\x00\x7e", b"\x83\x03"),
        (b"\x03\x00\x6b\x00\x04", b"\x83\x02"),
        (b"\x06\x00\x6b\x00\x01", b"\x86\x02"),
        (b"\x2b\x0e\x01\x00", b"\xab\x01"),
    ],
)
def test_invalid_requests_are_refused(request_: bytes, answer: bytes) -> None:
    drive = SimulatedRegisters(lambda unit: {107: 0x022B, 108: 0, 109: 0x0064})
    frame = struct.pack(">HHHB", 7, 0, len(request_) + 1, 1) + request_
    (sent,) = drive.take_tcp(bytearray(frame))
    assert sent[7:] == answer


def test_a_request_in_pieces_and_with_noise_is_answered() -> None:
    drive = SimulatedRegisters(lambda unit: {5: 0x1234} if unit == 3 else None)
    body = b"\x03\x03\x00\x05\x00\x01"
    frame = body + struct.pack("<H", crc16(body))
    buffer = bytearray(b"\xff\x00\x41")
    answers: list[bytes] = []
    for byte in frame:
        buffer.append(byte)
        answers += drive.take_rtu(buffer)
    assert len(answers) == 1
    assert answers[0][:5] == b"\x03\x03\x02\x12\x34"
    assert crc16(answers[0]) == 0
