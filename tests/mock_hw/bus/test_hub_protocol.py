"""Hub packets are encoded and decoded unchanged; damaged ones are refused."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.errors import ProtocolError
from mock_hw.bus.arbitration import WireFrame
from mock_hw.bus.hub_protocol import (
    FRAME,
    HEADER,
    HubRole,
    PacketKind,
    pack,
    pack_identifiers,
    unpack_frames,
    unpack_header,
    unpack_identifiers,
)
from tests.builders.raised_codes import raises_code


def test_frames_are_decoded_as_encoded() -> None:
    frames = [WireFrame(-1, 0x181, 3, 2, b"abc"), WireFrame(2**61, 0x9FFF_FFFF, 8, 0, b"12345678")]
    packet = pack(PacketKind.IDLE, 1, 7, 12) + b"".join(FRAME.pack(*f) for f in frames)
    assert unpack_header(packet) == (PacketKind.IDLE, 1, 7, 12)
    assert [f._replace(data=f.data[: f.length]) for f in unpack_frames(packet)] == frames


def test_a_hello_contains_the_urgent_identifiers() -> None:
    packet = pack(PacketKind.HELLO, HubRole.DEVICE) + pack_identifiers([0x000, 0x080, 0x601])
    assert unpack_identifiers(packet[HEADER.size :]) == {0x000, 0x080, 0x601}


@given(st.binary(max_size=200))
def test_garbage_is_decoded_as_frames_or_refused(packet: bytes) -> None:
    try:
        unpack_header(packet)
        frames = unpack_frames(packet)
    except ProtocolError:
        return
    assert all(frame.length <= 8 for frame in frames)


@pytest.mark.parametrize("can_id", [0x800, 0x2000_0040, 0xC000_0000 | 1 << 29])
def test_invalid_can_identifiers_are_refused(can_id: int) -> None:
    with raises_code(ProtocolError, "RID-MOCK-PROTOCOL"):
        unpack_frames(pack(PacketKind.SEND) + FRAME.pack(0, can_id, 0, 0, b""))
