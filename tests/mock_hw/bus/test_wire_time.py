"""Exact time of every frame on the wire; identifiers decide the order."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mock_hw.bus.wire_time import EXTENDED_FLAG, REMOTE_FLAG, arbitration_key, wire_bits

payloads = st.one_of(
    st.binary(max_size=8),
    st.lists(st.sampled_from([0x00, 0xFF, 0x0F, 0x1F, 0x83]), max_size=8).map(bytes),
)


def counted_bits(can_id: int, data: bytes) -> int:
    """Count the bits of a standard data frame bit by bit, as in the standard."""
    bits = [0, *(can_id >> shift & 1 for shift in range(10, -1, -1)), 0, 0, 0]
    bits += [len(data) >> shift & 1 for shift in (3, 2, 1, 0)]
    bits += [byte >> shift & 1 for byte in data for shift in range(7, -1, -1)]
    crc = 0
    for bit in bits:
        crc = (crc << 1 & 0x7FFF) ^ (0x4599 if bit ^ crc >> 14 else 0)
    bits += [crc >> shift & 1 for shift in range(14, -1, -1)]
    count, run, last = 0, 0, -1
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        count += 1
        if run == 5:
            count, last, run = count + 1, 1 - last, 1
    return count + 1 + 2 + 7 + 3


def test_sync_takes_51_bits() -> None:
    assert wire_bits(0x080, b"") == 51


@given(can_id=st.integers(0, 0x7FF), data=payloads)
def test_tables_agree_with_bit_counting(can_id: int, data: bytes) -> None:
    assert wire_bits(can_id, data) == counted_bits(can_id, data)


def test_a_known_frame_has_its_known_length() -> None:
    assert wire_bits(0x181, bytes.fromhex("3716a0860100f4ff")) == 118


def test_extended_and_remote_frames_have_their_known_length() -> None:
    plain = wire_bits(0x123, bytes(8))
    assert 20 <= wire_bits(EXTENDED_FLAG | 0x123 << 18, bytes(8)) - plain <= 26
    assert wire_bits(REMOTE_FLAG | 0x123, b"", 8) < wire_bits(0x123, bytes(range(8)))


@pytest.mark.parametrize(
    ("winner", "loser"),
    [
        (0x000, 0x001),
        (0x080, 0x181),
        (0x181, 0x181 | REMOTE_FLAG),
        (0x181, EXTENDED_FLAG | 0x181 << 18),
        (0x181 | REMOTE_FLAG, EXTENDED_FLAG | 0x181 << 18),
        (EXTENDED_FLAG | 0x180 << 18 | 0x3FFFF, 0x181),
        (EXTENDED_FLAG | 0x100, EXTENDED_FLAG | 0x101),
    ],
)
def test_arbitration_prefers_lower_identifiers(winner: int, loser: int) -> None:
    assert arbitration_key(winner) < arbitration_key(loser)
