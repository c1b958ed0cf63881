"""Protocol between the CAN hub and its clients.

A packet consists of a header and at most 1024 frames (in HELLO: identifiers). It is one message on
a local SEQPACKET socket, so it arrives completely or not at all. A line of the table is: sender,
kind of packet, content.

    client  HELLO    the client's role, and its urgent identifiers
    hub     WELCOME  answer to HELLO: lock-step or real time, and the present time
    client  SEND     frames to transmit
    client  IDLE     frames to transmit; the client then waits until `time_ns` or for frames
    hub     FRAMES   frames that were on the bus
    hub     WAKE     end of the wait of the IDLE with the same number: frames, and the present time

In lock-step the hub advances time only while every master and device waits. In real time clients
send no IDLE.
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
"""Value of `port` in the copy of a frame that its own sender receives."""

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
    """Role of a client: all except observers stop simulated time while they work."""

    MASTER = 1
    DEVICE = 2
    OBSERVER = 3


def protocol_violation(problem: str) -> ProtocolError:
    """Return the error for a packet that does not follow the hub's protocol."""
    return ProtocolError(f"CAN hub: {problem}", code="RID-MOCK-PROTOCOL")


def pack(kind: PacketKind, flag: int = 0, number: int = 0, time_ns: int = 0) -> bytes:
    """Return the header of a packet.

    Args:
        kind: Kind of the packet.
        flag: HELLO: role of the client. WELCOME: 1 in lock-step. IDLE: 1 if frames end the wait.
        number: IDLE and WAKE: number of the wait. HELLO: 1 if the client receives its own frames.
        time_ns: WELCOME and WAKE: the present time. IDLE: time until which the client waits [ns].
    """
    return HEADER.pack(kind, flag, number, time_ns)


def pack_identifiers(identifiers: Iterable[int]) -> bytes:
    """Return the body of a HELLO packet: standard identifiers, two bytes each."""
    return b"".join(identifier.to_bytes(2, "little") for identifier in identifiers)


def unpack_identifiers(body: bytes | memoryview) -> frozenset[int]:
    """Return the identifiers in the body of a HELLO packet."""
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
        errors: True to accept error frames, by which the hub reports errors of a client's adapter.

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
