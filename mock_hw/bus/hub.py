"""`CanHub`: the simulated CAN bus between processes, in lock-step or in real time."""

from __future__ import annotations

import math
import select
import socket
import time
from collections import deque
from collections.abc import Sequence
from typing import TextIO

from config.errors import ProtocolError
from mock_hw.bus.arbitration import FOREVER_NS, CanWire, Delivery, WireFrame, candump_line
from mock_hw.bus.faults import BusFaults
from mock_hw.bus.hub_protocol import (
    FRAME,
    FRAMES_PER_PACKET,
    HEADER,
    OWN_PORT,
    PACKET_BYTES,
    HubRole,
    PacketKind,
    pack,
    protocol_violation,
    unpack_frames,
    unpack_header,
    unpack_identifiers,
)
from mock_hw.bus.pace import PaceKeeper
from mock_hw.bus.wire_time import ERROR_FLAG

AFTER_RUN_NS = 2_000_000_000
"""Duration of lock-step time at the wall clock's pace after the last master has left [ns]."""

_LONGEST_BURST_NS = 1_000_000
_LONGEST_AGO_NS = 1_000_000
_LONGEST_SELECT_S = 3600.0
_LONGEST_WAIT_NS = 24 * 3600 * 10**9  # a longer wait is a mistake of the client
_INBOX_FRAMES = 4096
_BUFFER_BYTES = 1 << 20
_BUS_OFF = ERROR_FLAG | 0x40


class _Client:
    """A connection: what it waits for, and the frames that were not sent to it yet."""

    def __init__(self, key: int, connection: socket.socket) -> None:
        self.key = key
        self.socket = connection
        self.role: HubRole | None = None
        self.urgent: frozenset[int] = frozenset()
        self.own_frames = False
        self.idle = True
        self.due_ns = FOREVER_NS
        self.on_frames = False
        self.number = 0
        self.inbox: deque[bytes] = deque(maxlen=_INBOX_FRAMES)


class CanHub:
    """A CAN bus between the clients of a socket: a `SimulatedDevice` on the computer's clock.

    In real time, a frame is forwarded when its transmission time is over. A device gives each frame
    a time of sending. The transmission counts from this time if the bus was free then and the time
    is recent, so that the computing time of a simulated device is not bus time.

    In lock-step, the hub owns the time. It is a conservative discrete-event simulation: time moves
    to the next event only while every master and device waits. Order and times therefore depend
    only on the frames. After the last master has left, time continues at the wall clock's pace for
    `AFTER_RUN_NS`, so that drives detect the loss of their master. Then it stands still; the next
    master always joins at this time.

    Args:
        listener: A listening SEQPACKET socket; closed by `close`.
        bitrate: Nominal bit rate [bit/s].
        realtime: True for real time, False for lock-step.
        pace: Largest number of simulated seconds per second, in lock-step with a master.
        channel: Name of the bus in the log.
        log: File for all frames in candump's format; in real time with seconds since 1970.
        faults: Faults of the bus; None for no faults.

    Attributes:
        next_s: Time of the bus's next action of its own, as of the last `advance` [s].
    """

    def __init__(
        self,
        listener: socket.socket,
        bitrate: int,
        *,
        realtime: bool,
        pace: float | None = None,
        channel: str = "rid_sim",
        log: TextIO | None = None,
        faults: BusFaults | None = None,
    ) -> None:
        self._faults = faults
        self._listener = listener
        self._wire = CanWire(bitrate)
        self._realtime = realtime
        self._channel = channel
        self._log = log
        self._epoch_ns = time.time_ns() - time.monotonic_ns() if realtime else 0
        self._now_ns = time.monotonic_ns() if realtime else 0
        self._clients: dict[int, _Client] = {}
        self._timed: list[_Client] = []
        self._joining: list[_Client] = []
        self._to_wake: list[_Client] = []
        self._next_key = self._busy = self._masters = 0
        self._horizon_ns = 0
        self._masterless_pace = PaceKeeper(1.0)
        self._master_pace = PaceKeeper(pace)
        self.next_s = 0.0

    def run(self, stop_fds: Sequence[int], stop_at_ns: int = FOREVER_NS) -> None:
        """Serve until one of `stop_fds` is readable or CLOCK_MONOTONIC has reached `stop_at_ns`."""
        stop_at_s = stop_at_ns * 1e-9
        while (now_s := time.monotonic()) < stop_at_s:
            self.advance(now_s)
            wait_s = min(self.next_s, stop_at_s) - time.monotonic()
            if self._serve(stop_fds, min(max(0.0, wait_s), _LONGEST_SELECT_S)):
                return

    def advance(self, until_s: float) -> None:
        """Do all bus actions that are due until `until_s` [s, CLOCK_MONOTONIC].

        In lock-step, do all actions that are possible before a client must send something, at the
        pace if one is set.
        """
        until_ns = round(until_s * 1e9)
        if self._realtime:
            self._advance_realtime(until_ns)
        else:
            self._advance_lockstep(until_ns)

    def close(self) -> None:
        """Disconnect every client and close the listening socket."""
        for client in [*self._clients.values()]:
            client.socket.close()
        self._clients.clear()
        self._listener.close()
        if self._log is not None:
            self._log.flush()

    # Real time

    def _advance_realtime(self, until_ns: int) -> None:
        wire = self._wire
        self._now_ns = until_ns
        while wire.next_ns <= self._now_ns:
            if (delivery := wire.step()) is not None:
                self._deliver(delivery)
        self._send_frames(observers_only=False)
        self.next_s = wire.next_ns * 1e-9

    # Lock-step

    def _advance_lockstep(self, until_ns: int) -> None:
        """Advance the time while all clients wait."""
        self.next_s = math.inf
        while self._busy == 0:
            next_ns = self._wire.next_ns
            for client in self._timed:
                if client.due_ns < next_ns:
                    next_ns = client.due_ns
            if not self._masters:
                if next_ns > self._horizon_ns and self._joining:
                    self._now_ns = max(self._now_ns, self._horizon_ns)
                    self._admit_masters()
                    break
                over = next_ns > self._horizon_ns
                if not self._joining and (
                    over or self._is_later(self._masterless_pace, next_ns, until_ns)
                ):
                    break
            elif next_ns == FOREVER_NS or self._is_later(self._master_pace, next_ns, until_ns):
                break
            self._now_ns = max(self._now_ns, next_ns)
            self._handle_event()
        self._send_frames(observers_only=True)

    def _is_later(self, pace: PaceKeeper, next_ns: int, until_ns: int) -> bool:
        """Return True if an event is later than `until_ns`; store its time in `next_s`."""
        if (wall_ns := pace.wall_ns(next_ns, until_ns)) > until_ns:
            self.next_s = wall_ns * 1e-9
        return wall_ns > until_ns

    def _handle_event(self) -> None:
        """Do the due actions: end a frame, wake clients, then start the next frame."""
        wire, now_ns = self._wire, self._now_ns
        over = False
        if wire.sending and wire.next_ns <= now_ns:
            if (delivery := wire.step()) is not None:
                self._deliver(delivery)
            over = not wire.backlog(now_ns)
        for client in self._timed:
            if client.idle and (
                client.due_ns <= now_ns or (over and client.on_frames and client.inbox)
            ):
                self._to_wake.append(client)
        for client in self._to_wake:
            self._wake(client)
        self._to_wake.clear()
        if self._busy == 0 and not wire.sending and wire.next_ns <= now_ns:
            wire.step()

    def _wake(self, client: _Client) -> None:
        client.idle = False
        client.due_ns = FOREVER_NS
        self._busy += 1
        self._send_inbox(client, pack(PacketKind.WAKE, 0, client.number, self._now_ns))

    def _admit_masters(self) -> None:
        joining, self._joining = self._joining, []  # clients that have left are dropped as members
        self._master_pace.begin(time.monotonic_ns(), self._now_ns)
        for client in joining:
            self._masters += 1
            self._welcome(client)

    # Frames

    def _deliver(self, delivery: Delivery) -> None:
        (key, _), frame = delivery
        record = FRAME.pack(*frame)
        cut_off = self._faults is not None and frame.time_ns < self._faults.cut_off_until_ns
        for client in self._clients.values():
            own = client.key == key
            if client.role is not None and (client.own_frames or not own):
                if cut_off and client.role == HubRole.MASTER:
                    continue
                client.inbox.append(FRAME.pack(*frame._replace(port=OWN_PORT)) if own else record)
                if frame.can_id in client.urgent:
                    client.due_ns = frame.time_ns
                elif client.on_frames:
                    client.due_ns = min(client.due_ns, frame.time_ns + _LONGEST_BURST_NS)
        if self._log is not None:
            self._log.write(candump_line(frame, frame.time_ns + self._epoch_ns, self._channel))

    def _send_frames(self, *, observers_only: bool) -> None:
        for client in [*self._clients.values()]:
            if client.inbox and not (observers_only and client.role != HubRole.OBSERVER):
                self._send_inbox(client, pack(PacketKind.FRAMES, 0, 0, self._now_ns))

    def _send_inbox(self, client: _Client, header: bytes) -> None:
        """Send a client its frames; drop the frames of a client that does not read."""
        inbox = client.inbox
        try:
            while len(inbox) > FRAMES_PER_PACKET:
                some = [inbox.popleft() for _ in range(FRAMES_PER_PACKET)]
                client.socket.send(pack(PacketKind.FRAMES) + b"".join(some))
            client.socket.send(header + b"".join(inbox))
        except BlockingIOError:
            if client in self._timed:
                self._drop(client)
        except OSError:
            self._drop(client)
        inbox.clear()

    # Clients

    def _serve(self, stop_fds: Sequence[int], timeout_s: float) -> bool:
        """Read from clients for at most `timeout_s`; return True if the hub must stop."""
        clients = [*self._clients.values()]
        waiting: list[int | socket.socket] = [
            *stop_fds,
            self._listener,
            *(client.socket for client in clients),
        ]
        readable, _, _ = select.select(waiting, [], [], timeout_s)
        if not readable:
            return False
        if any(stop_fd in readable for stop_fd in stop_fds):
            return True
        if self._listener in readable:
            self._accept()
        for client in clients:
            if client.socket in readable:
                self._read(client)
        return False

    def _accept(self) -> None:
        try:
            connection, _ = self._listener.accept()
        except OSError:
            return
        connection.setblocking(False)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER_BYTES)
        self._clients[self._next_key] = _Client(self._next_key, connection)
        self._next_key += 1

    def _read(self, client: _Client) -> None:
        try:
            packet = client.socket.recv(PACKET_BYTES)
            if packet:
                self._handle(client, packet)
                return
        except BlockingIOError:
            return
        except (OSError, ProtocolError, ValueError):
            self._drop(client)
            return
        self._drop(client)

    def _handle(self, client: _Client, packet: bytes) -> None:
        kind, flag, number, time_ns = unpack_header(packet)
        if kind == PacketKind.HELLO and client.role is None:
            client.own_frames = bool(number)
            self._join(client, HubRole(flag), packet)
        elif kind in (PacketKind.SEND, PacketKind.IDLE) and client.role is not None:
            now_ns = time.monotonic_ns() if self._realtime else self._now_ns
            latest_ns = now_ns + _LONGEST_WAIT_NS
            if latest_ns < time_ns != FOREVER_NS:
                raise protocol_violation(
                    f"a client waits until {time_ns} ns, which is too far in the future"
                )
            for frame in unpack_frames(packet):
                if frame.time_ns > latest_ns:
                    raise protocol_violation(
                        f"a client sends a frame at {frame.time_ns} ns, which is too far"
                        " in the future"
                    )
                self._queue(client, frame, now_ns)
            if kind == PacketKind.IDLE and client in self._timed:
                if self._faults is not None and client.role == HubRole.MASTER and not flag:
                    time_ns += self._faults.hold_up_ns()
                client.number, client.on_frames = number, bool(flag)
                client.due_ns = now_ns if client.inbox and flag else time_ns
                if not client.idle:
                    client.idle = True
                    self._busy -= 1
        else:
            raise protocol_violation(f"unexpected packet of kind {kind}")

    def _queue(self, client: _Client, frame: WireFrame, now_ns: int) -> None:
        source, faults = (client.key, frame.port), self._faults
        if self._realtime and client.role == HubRole.DEVICE and frame.time_ns:
            now_ns = max(now_ns - _LONGEST_AGO_NS, min(now_ns, frame.time_ns))
        if faults is None:
            self._wire.queue(source, frame, now_ns)
            return
        from_master = client.role == HubRole.MASTER
        for each, spoiled in faults.take(source, frame, now_ns, from_master=from_master):
            self._wire.queue(each, spoiled, now_ns)
        if faults.bus_off:
            faults.bus_off = False
            self._send_to_masters(WireFrame(now_ns, _BUS_OFF, 8, 0, bytes(8)))
        if faults.unplugged:
            faults.unplugged = False
            for each_client in [*self._clients.values()]:
                if each_client.role == HubRole.MASTER:
                    self._drop(each_client)

    def _send_to_masters(self, frame: WireFrame) -> None:
        """Send every master a frame of its own adapter at once."""
        for client in self._clients.values():
            if client.role == HubRole.MASTER:
                client.inbox.append(FRAME.pack(*frame))
                if client.on_frames:
                    client.due_ns = min(client.due_ns, frame.time_ns)

    def _join(self, client: _Client, role: HubRole, packet: bytes) -> None:
        now_ns = time.monotonic_ns() if self._realtime else self._now_ns
        if role == HubRole.MASTER and self._faults and now_ns < self._faults.unplugged_until_ns:
            self._drop(client)
            return
        client.urgent = unpack_identifiers(packet[HEADER.size :])
        client.role = role
        if role == HubRole.MASTER and not self._realtime and not self._masters:
            self._joining.append(client)
            return
        self._masters += role == HubRole.MASTER
        self._welcome(client)

    def _welcome(self, client: _Client) -> None:
        if client.role != HubRole.OBSERVER and not self._realtime:
            self._timed.append(client)
            client.idle = False
            self._busy += 1
        client.inbox.clear()
        header = pack(PacketKind.WELCOME, not self._realtime, 0, self._now_ns)
        self._send_inbox(client, header)

    def _drop(self, client: _Client) -> None:
        if self._clients.pop(client.key, None) is None:
            return
        client.socket.close()
        if client in self._joining:
            self._joining.remove(client)
            return
        if client in self._timed:
            self._timed.remove(client)
            if not client.idle:
                self._busy -= 1
            if client.role == HubRole.MASTER:
                self._masters -= 1
                if not self._masters:
                    back_ns = self._faults.unplugged_until_ns if self._faults else 0
                    self._horizon_ns = max(self._now_ns + AFTER_RUN_NS, back_ns)
                    self._masterless_pace.begin(time.monotonic_ns(), self._now_ns)
