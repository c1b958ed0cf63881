"""`HubClient`: a client's connection to the hub of a simulated CAN bus."""

from __future__ import annotations

import contextlib
import select
import socket
import time
from collections.abc import Iterable
from pathlib import Path

from config.errors import ProtocolError, TransportError
from mock_hw.bus.arbitration import FOREVER_NS, WireFrame
from mock_hw.bus.hub_protocol import (
    FRAME,
    FRAMES_PER_PACKET,
    HEADER,
    PACKET_BYTES,
    HubRole,
    PacketKind,
    pack,
    pack_identifiers,
    unpack_frames,
    unpack_header,
)


class HubClient:
    """A connection to the hub of a simulated CAN bus.

    In lock-step, simulated time advances only while all masters and devices are in `wait`. Frames
    that are passed to `post` are sent at the next `wait`.

    Args:
        path: Socket of the hub.
        role: Role of the client. An observer never stops simulated time, and waits in real time.
        urgent: Identifiers whose frames end every wait immediately. Other frames end a wait only if
            `on_frames` is True, and only when the bus becomes idle, so that a burst of frames ends
            one wait only.
        timeout_s: Longest wait for the hub's first answer (WELCOME) [s].
        own_frames: True to receive the client's own frames after their transmission, with port
            `OWN_PORT`.

    Attributes:
        simulated_time: True if the bus has simulated time instead of CLOCK_MONOTONIC.
        lockstep: True if the bus has simulated time and this client takes part in it.
        now_ns: Present time [ns]: simulated, or CLOCK_MONOTONIC at the last `wait`.

    Raises:
        TransportError: No hub listens at the socket, or it does not answer in time.
        ProtocolError: The hub's first answer is not WELCOME.
    """

    def __init__(
        self,
        path: Path,
        role: HubRole,
        urgent: Iterable[int] = (),
        timeout_s: float = 30.0,
        *,
        own_frames: bool = False,
    ) -> None:
        self._path = path
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._buffer = memoryview(bytearray(PACKET_BYTES))
        self._outbox: list[bytes] = []
        self._number = 0
        try:
            self._socket.settimeout(timeout_s)
            self._socket.connect(str(path))
            self._socket.send(pack(PacketKind.HELLO, role, own_frames) + pack_identifiers(urgent))
            kind, flag, _, self.now_ns = unpack_header(self._receive())
            if kind != PacketKind.WELCOME:
                raise ProtocolError(
                    f"CAN hub {path}: the hub answered with packet kind {kind} instead of WELCOME",
                    code="RID-MOCK-PROTOCOL",
                )
        except OSError as error:
            self._socket.close()
            raise TransportError(
                f"simulated CAN bus {path}: no hub serves this socket ({error}); start it with"
                " 'rid-daq mock CELL', or check the channel's name",
                code="RID-MOCK-NOT-SERVED",
            ) from error
        except (ProtocolError, TransportError):
            self._socket.close()
            raise
        self._socket.settimeout(None)
        self.simulated_time = bool(flag)
        self.lockstep = self.simulated_time and role != HubRole.OBSERVER

    def fileno(self) -> int:
        """Return the socket's file descriptor; -1 when closed."""
        return self._socket.fileno()

    def post(self, can_id: int, data: bytes, length: int, port: int = 0, time_ns: int = 0) -> None:
        """Put a frame into the outbox; its transmission starts at `time_ns` or later."""
        self._outbox.append(FRAME.pack(time_ns, can_id, length, port, data))

    def send(self, can_id: int, data: bytes, length: int) -> None:
        """Send one frame to the hub immediately, without the outbox; callable from any thread.

        Raises:
            TransportError: The hub has ended.
        """
        try:
            self._socket.send(pack(PacketKind.SEND) + FRAME.pack(0, can_id, length, 0, data))
        except OSError as error:
            raise self._lost(str(error)) from error

    def send_all(self, frames: Iterable[tuple[int, bytes | bytearray]]) -> None:
        """Send data frames (identifier and data) to the hub immediately, in one packet.

        Raises:
            TransportError: The hub has ended.
        """
        body = [FRAME.pack(0, can_id, len(data), 0, data) for can_id, data in frames]
        try:
            self._socket.send(pack(PacketKind.SEND) + b"".join(body))
        except OSError as error:
            raise self._lost(str(error)) from error

    def take_all(self, timeout_s: float) -> list[tuple[int, int, int, int, bytes]]:
        """Return all frames that have arrived, in real time, as tuples like `WireFrame`.

        The call waits at most `timeout_s` [s] for the first frame. The frames are not checked,
        because the hub transmits only classic CAN frames.

        Raises:
            TransportError: The hub has ended.
        """
        frames: list[tuple[int, int, int, int, bytes]] = []
        buffer, receive = self._buffer, self._socket.recv_into
        try:
            while True:
                try:
                    count = receive(buffer, 0, socket.MSG_DONTWAIT)
                except BlockingIOError:
                    if frames or timeout_s <= 0.0:
                        return frames
                    if not select.select([self._socket], [], [], timeout_s)[0]:
                        return frames
                    timeout_s = 0.0
                    continue
                if count == 0:
                    if frames:  # the next call finds no frames and raises the error
                        return frames
                    raise self._lost("connection closed")
                frames += FRAME.iter_unpack(buffer[HEADER.size : count])
        except (OSError, ValueError) as error:
            raise self._lost(str(error)) from error

    def wait(self, until_ns: int = FOREVER_NS, on_frames: bool = True) -> list[WireFrame]:
        """Send the outbox; wait until `until_ns`, or until frames arrive.

        Returns:
            Frames that were on the bus during the wait, oldest first; data padded to 8 bytes. In
            real time, every frame ends the wait.

        Raises:
            TransportError: The hub has ended.
        """
        if not self.lockstep:
            return self._wait(until_ns)
        self.begin_wait(until_ns, on_frames)
        return self.end_wait()

    def begin_wait(self, until_ns: int = FOREVER_NS, on_frames: bool = True) -> None:
        """Do the first half of a lock-step `wait`: this client no longer stops simulated time."""
        self._number = (self._number + 1) & 0xFFFFFFFF
        self._transmit(pack(PacketKind.IDLE, on_frames, self._number, until_ns))

    def end_wait(self) -> list[WireFrame]:
        """Do the second half of a lock-step `wait`: return the frames when the wait is over.

        The ends of earlier waits that were interrupted are ignored.
        """
        frames: list[WireFrame] = []
        while True:
            packet = self._receive()
            kind, _, number, time_ns = unpack_header(packet)
            frames += unpack_frames(packet, errors=True)
            if kind == PacketKind.WAKE and number == self._number:
                self.now_ns = time_ns
                return frames

    def close(self) -> None:
        """Send the outbox, if the hub still exists; then disconnect."""
        with contextlib.suppress(TransportError):
            self._flush()
        self._socket.close()

    def _wait(self, until_ns: int) -> list[WireFrame]:
        self._flush()
        timeout_s = None
        if until_ns != FOREVER_NS:
            timeout_s = max(0.0, (until_ns - time.monotonic_ns()) * 1e-9)
        frames: list[WireFrame] = []
        try:
            while select.select([self._socket], [], [], timeout_s)[0]:
                frames += unpack_frames(self._receive(), errors=True)
                timeout_s = 0.0
        except TransportError:
            if not frames:  # with frames, the next call raises the error
                raise
        except ValueError as error:
            raise self._lost("this connection is closed") from error
        self.now_ns = time.monotonic_ns()
        return frames

    def _flush(self) -> None:
        if self._outbox:
            self._transmit(pack(PacketKind.SEND))

    def _transmit(self, header: bytes) -> None:
        outbox = self._outbox
        try:
            while len(outbox) > FRAMES_PER_PACKET:
                self._socket.send(pack(PacketKind.SEND) + b"".join(outbox[:FRAMES_PER_PACKET]))
                del outbox[:FRAMES_PER_PACKET]
            self._socket.send(header + b"".join(outbox))
        except OSError as error:
            raise self._lost(str(error)) from error
        outbox.clear()

    def _receive(self) -> memoryview:
        try:
            count = self._socket.recv_into(self._buffer)
        except OSError as error:
            raise self._lost(str(error)) from error
        if count == 0:
            raise self._lost("connection closed")
        return self._buffer[:count]

    def _lost(self, why: str) -> TransportError:
        return TransportError(
            f"simulated CAN bus {self._path}: the hub has ended ({why})", code="RID-MOCK-ENDED"
        )
