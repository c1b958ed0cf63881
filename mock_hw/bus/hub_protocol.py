"""What the CAN hub and its clients say to each other, packet by packet.

A packet is a header and any number of frames; one packet is one message of a local SEQPACKET
socket, so it arrives whole or not at all.

    client  HELLO    role; the identifiers that wake the client at once
    hub     WELCOME  whether time is in lock-step, and what time it is
    client  SEND     frames to be sent now
    client  IDLE     the same, and: nothing to do until `time_ns` (or, if asked for, a frame)
    hub     FRAMES   frames that were on the bus
    hub     WAKE     the same, as the answer to the IDLE of the same number; time is `time_ns`

In lock-step the hub moves time on only while every master and device is idle. `SEND` is all that
clients say in real time.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from enum import IntEnum

from config.errors import ProtocolError
from mock_hw.bus.arbitration import WireFrame
from mock_hw.bus.wire_time import (
    ERROR_FLAG,
    EXTENDED_FLAG,
    EXTENDED_MASK,
    REMOTE_FLAG,
    STANDARD_MASK,
)

HEADER = struct.Struct("<BBxxIq")
FRAME = struct.Struct("<qIBB2x8s")

FRAMES_PER_PACKET = 1024
OWN_PORT = 255
"""The port of a frame that its sender gets back."""

PACKET_BYTES = HEADER.size + FRAMES_PER_PACKET * FRAME.size


class PacketKind(IntEnum):
    """What a packet is for."""

    HELLO = 1
    WELCOME = 2
    SEND = 3
    IDLE = 4
    FRAMES = 5
    WAKE = 6


class HubRole(IntEnum):
    """What a client is to the hub: masters and devices hold lock-step time, observers never do."""

    MASTER = 1
    DEVICE = 2
    OBSERVER = 3


def misuse(problem: str) -> ProtocolError:
    """Return the error of a packet that does not follow the hub's protocol."""
    return ProtocolError(f"CAN hub: {problem}", code="RID-MOCK-PROTOCOL")


def pack(kind: PacketKind, flag: int = 0, number: int = 0, time_ns: int = 0) -> bytes:
    """Return a header.

    Args:
        kind: What the packet is for.
        flag: HELLO: the role. WELCOME: 1 in lock-step. IDLE: 1 when frames wake the client.
        number: Of an IDLE, and of the WAKE that answers it. HELLO: 1 to get back what is sent.
        time_ns: WELCOME, WAKE: the present time. IDLE: until when the client has nothing to do.
    """
    return HEADER.pack(kind, flag, number, time_ns)


def pack_identifiers(identifiers: Iterable[int]) -> bytes:
    """Return the body of a HELLO: standard identifiers, two bytes each."""
    return b"".join(identifier.to_bytes(2, "little") for identifier in identifiers)


def unpack_identifiers(body: bytes | memoryview) -> frozenset[int]:
    """Return the identifiers in the body of a HELLO."""
    return frozenset(
        int.from_bytes(body[start : start + 2], "little") for start in range(0, len(body), 2)
    )


def unpack_header(packet: bytes | memoryview) -> tuple[int, int, int, int]:
    """Return kind, flag, number and time [ns] of a packet.

    Raises:
        ProtocolError: The packet is shorter than a header.
    """
    if len(packet) < HEADER.size:
        raise misuse(f"a packet of {len(packet)} bytes has no header")
    kind, flag, number, time_ns = HEADER.unpack_from(packet)
    return kind, flag, number, time_ns


def unpack_frames(packet: bytes | memoryview, *, errors: bool = False) -> list[WireFrame]:
    """Return the frames of a packet; their data are padded to 8 bytes.

    With `errors` a client takes what its adapter reports, as error frames; nobody sends those.

    Raises:
        ProtocolError: The packet ends within a frame, or a frame is none of classic CAN.
    """
    body = memoryview(packet)[HEADER.size :]
    if len(body) % FRAME.size:
        raise misuse(f"a packet of {len(packet)} bytes ends within a frame")
    frames = [WireFrame._make(fields) for fields in FRAME.iter_unpack(body)]
    flags = EXTENDED_FLAG | REMOTE_FLAG | (ERROR_FLAG if errors else 0)
    for frame in frames:
        highest = EXTENDED_MASK if frame.can_id & EXTENDED_FLAG else STANDARD_MASK
        if frame.length > 8 or frame.can_id & ~flags > highest:
            raise misuse(f"{frame.can_id:08X}h with {frame.length} bytes is no classic CAN frame")
    return frames
