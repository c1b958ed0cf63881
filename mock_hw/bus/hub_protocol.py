"""Protocol between the CAN hub and its clients.

A packet is a header and any number of frames. It is one message of a local SEQPACKET socket, so it
arrives completely or not at all.

    client  HELLO    role; identifiers that wake the client at once
    hub     WELCOME  lock-step or real time, and the present time
    client  SEND     frames to be sent now
    client  IDLE     as SEND; the client then waits until `time_ns` (or, if requested, for a frame)
    hub     FRAMES   frames that were on the bus
    hub     WAKE     as FRAMES, as the answer to the IDLE of the same number; time is `time_ns`

In lock-step the hub advances time only while every master and device is idle. In real time clients
send only `SEND`.
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
"""Port of a frame that its sender receives back."""

PACKET_BYTES = HEADER.size + FRAMES_PER_PACKET * FRAME.size


class PacketKind(IntEnum):
    """Kind of a packet."""

    HELLO = 1
    WELCOME = 2
    SEND = 3
    IDLE = 4
    FRAMES = 5
    WAKE = 6


class HubRole(IntEnum):
    """Role of a client: masters and devices stop lock-step time during work, observers never."""

    MASTER = 1
    DEVICE = 2
    OBSERVER = 3


def protocol_violation(problem: str) -> ProtocolError:
    """Return the error for a packet that violates the hub's protocol."""
    return ProtocolError(f"CAN hub: {problem}", code="RID-MOCK-PROTOCOL")


def pack(kind: PacketKind, flag: int = 0, number: int = 0, time_ns: int = 0) -> bytes:
    """Return a header.

    Args:
        kind: Kind of the packet.
        flag: HELLO: the role. WELCOME: 1 in lock-step. IDLE: 1 if frames wake the client.
        number: Number of an IDLE, and of the WAKE that answers it. HELLO: 1 to receive own frames.
        time_ns: WELCOME, WAKE: the present time. IDLE: time until which the client waits.
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
        raise protocol_violation(f"a packet of {len(packet)} bytes has no header")
    kind, flag, number, time_ns = HEADER.unpack_from(packet)
    return kind, flag, number, time_ns


def unpack_frames(packet: bytes | memoryview, *, errors: bool = False) -> list[WireFrame]:
    """Return the frames of a packet; their data are padded to 8 bytes.

    Args:
        errors: True to accept error frames, which the hub sends to clients for their adapter.

    Raises:
        ProtocolError: The packet ends within a frame, or a frame is not classic CAN.
    """
    body = memoryview(packet)[HEADER.size :]
    if len(body) % FRAME.size:
        raise protocol_violation(f"a packet of {len(packet)} bytes ends within a frame")
    frames = [WireFrame._make(fields) for fields in FRAME.iter_unpack(body)]
    flags = EXTENDED_FLAG | REMOTE_FLAG | (ERROR_FLAG if errors else 0)
    for frame in frames:
        highest = EXTENDED_MASK if frame.can_id & EXTENDED_FLAG else STANDARD_MASK
        if frame.length > 8 or frame.can_id & ~flags > highest:
            raise protocol_violation(
                f"{frame.can_id:08X}h with {frame.length} bytes is not a classic CAN frame"
            )
    return frames
