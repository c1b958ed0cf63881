"""`CanHub`: simulated CAN bus that connects its clients, in lock-step or in real time."""

from __future__ import annotations

import math
import select
import socket
import time
from collections.abc import Iterable, Sequence
from typing import TextIO

from config.errors import ProtocolError
from mock_hw.bus.arbitration import FOREVER_NS, CanWire, Delivery, WireFrame, candump_line
from mock_hw.bus.faults import BusFaults
from mock_hw.bus.hub_member import HubMember, SocketMember
from mock_hw.bus.hub_protocol import (
    HEADER,
    OWN_PORT,
    HubRole,
    PacketKind,
    protocol_violation,
    unpack_frames,
    unpack_header,
    unpack_identifiers,
)
from mock_hw.bus.pace import PaceKeeper
from mock_hw.bus.wire_time import ERROR_FLAG

AFTER_RUN_NS = 2_000_000_000
"""Simulated time that still passes in lock-step, at the pace of real time, after the last master
has left [ns]; more if the adapter is unplugged for longer."""

_LONGEST_BURST_NS = 1_000_000
_LONGEST_AGO_NS = 1_000_000
_LONGEST_SELECT_S = 3600.0
_LONGEST_WAIT_NS = 24 * 3600 * 10**9  # a longer wait is an error of the client
_BUS_OFF = ERROR_FLAG | 0x40


class CanHub:
    """A CAN bus that connects its clients; it is a `SimulatedDevice` on the computer's clock.

    A client is another process, connected by a socket, or, in lock-step, the hub's own process.

    In real time, a frame is delivered when its transmission time is over. A device gives each frame
    a time of sending. If this time is recent and the bus was free then, the transmission starts at
    this time. Therefore the computing time of a device does not delay its frames.

    In lock-step, the hub controls simulated time, as a conservative discrete-event simulation: time
    moves to the next event only while every master and device waits. Therefore order and times of
    events depend only on the frames. After the last master has left, simulated time continues at
    the pace of real time for `AFTER_RUN_NS`, so that the drives detect this. Then it stands still;
    the next master always joins at this time.

    Args:
        listener: A listening SEQPACKET socket; closed by `close`.
        bitrate: Nominal bit rate [bit/s].
        realtime: True for real time, False for lock-step.
        pace: In lock-step with a master, limit of simulated seconds per second; None for none.
        channel: Name of the bus in the log.
        log: File for all frames in candump's format; in real time, times are seconds since 1970.
        faults: Faults of the bus; None for no faults.

    Attributes:
        next_s: Time of the bus's next action, computed by the last `advance` [s].
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
        self._members: dict[int, HubMember] = {}
        self._sockets: list[SocketMember] = []
        self._timed: list[HubMember] = []
        self._joining: list[HubMember] = []
        self._to_wake: list[HubMember] = []
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
            if self.receive(stop_fds, stop_at_s):
                return

    def advance(self, until_s: float) -> None:
        """Do all actions of the bus that are due by `until_s` [s, CLOCK_MONOTONIC].

        In lock-step, do all actions that are possible until a client must send something, at most
        at the pace.
        """
        until_ns = round(until_s * 1e9)
        if self._realtime:
            self._advance_realtime(until_ns)
        else:
            self._advance_lockstep(until_ns)

    def receive(self, fds: Sequence[int], until_s: float) -> list[int]:
        """Wait for packets of clients, at most until the bus's next action, and process them.

        Args:
            fds: File descriptors that end the wait; they are checked before the clients.
            until_s: Latest end of the wait [s, CLOCK_MONOTONIC].

        Returns:
            The members of `fds` that are readable; if there are any, no client was read.
        """
        wait_s = min(max(0.0, min(self.next_s, until_s) - time.monotonic()), _LONGEST_SELECT_S)
        waiting: list[int | socket.socket | SocketMember]
        waiting = [*fds, self._listener, *self._sockets]
        readable, _, _ = select.select(waiting, [], [], wait_s)
        if others := [fd for fd in fds if fd in readable]:
            return others
        for member in readable:
            if isinstance(member, SocketMember):
                self._read(member)
        if self._listener in readable:
            self._accept()
        return []

    def add(self, member: HubMember, role: HubRole) -> None:
        """Add a client of this process; simulated time stands still until its first wait."""
        self._add(member)
        self._join(member, role)

    def begin_wait(
        self, member: HubMember, frames: Iterable[WireFrame], until_ns: int, *, on_frames: bool
    ) -> None:
        """Queue frames of a member, then let it wait until a time, or until frames if wanted."""
        now_ns = time.monotonic_ns() if self._realtime else self._now_ns
        for frame in frames:
            self._queue(member, frame, now_ns)
        if member not in self._timed:
            return
        if self._faults is not None and member.role == HubRole.MASTER and not on_frames:
            until_ns += self._faults.hold_up_ns()
        member.on_frames = on_frames
        member.due_ns = now_ns if member.inbox and on_frames else until_ns
        if not member.idle:
            member.idle = True
            self._busy -= 1

    def close(self) -> None:
        """Disconnect every client and close the listening socket."""
        for member in [*self._members.values()]:
            member.close()
        self._members.clear()
        self._sockets.clear()
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
        """Advance simulated time while all masters and devices wait."""
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
        """Return True if the pace delays an event beyond `until_ns`; set `next_s` to its time."""
        if (wall_ns := pace.wall_ns(next_ns, until_ns)) > until_ns:
            self.next_s = wall_ns * 1e-9
        return wall_ns > until_ns

    def _handle_event(self) -> None:
        """Do the actions that are due now: end a frame, wake clients, start the next frame."""
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

    def _wake(self, member: HubMember) -> None:
        member.idle = False
        member.due_ns = FOREVER_NS
        self._busy += 1
        self._send_inbox(member, PacketKind.WAKE)

    def _admit_masters(self) -> None:
        joining, self._joining = self._joining, []
        self._master_pace.begin(time.monotonic_ns(), self._now_ns)
        for member in joining:
            self._masters += 1
            self._welcome(member)

    # Frames

    def _deliver(self, delivery: Delivery) -> None:
        (key, _), frame = delivery
        cut_off = self._faults is not None and frame.time_ns < self._faults.cut_off_until_ns
        for member in self._members.values():
            own = member.key == key
            if member.role is not None and (member.own_frames or not own):
                if cut_off and member.role == HubRole.MASTER:
                    continue
                member.inbox.append(frame._replace(port=OWN_PORT) if own else frame)
                if frame.can_id in member.urgent:
                    member.due_ns = frame.time_ns
                elif member.on_frames:
                    member.due_ns = min(member.due_ns, frame.time_ns + _LONGEST_BURST_NS)
        if self._log is not None:
            self._log.write(candump_line(frame, frame.time_ns + self._epoch_ns, self._channel))

    def _send_frames(self, *, observers_only: bool) -> None:
        for member in [*self._members.values()]:
            if member.inbox and not (observers_only and member.role != HubRole.OBSERVER):
                self._send_inbox(member, PacketKind.FRAMES)

    def _send_inbox(self, member: HubMember, kind: PacketKind, flag: int = 0) -> None:
        """Send a member its frames; disconnect a master or device that does not read."""
        try:
            member.send(kind, flag, self._now_ns)
        except BlockingIOError:
            if member in self._timed:
                self.drop(member)
        except OSError:
            self.drop(member)
        member.inbox.clear()

    # Clients

    def _accept(self) -> None:
        try:
            connection, _ = self._listener.accept()
        except OSError:
            return
        member = SocketMember(connection)
        self._add(member)
        self._sockets.append(member)

    def _add(self, member: HubMember) -> None:
        member.key = self._next_key = self._next_key + 1
        self._members[member.key] = member

    def _read(self, member: SocketMember) -> None:
        try:
            packet = member.receive()
            if packet:
                self._handle(member, packet)
                return
        except BlockingIOError:
            return
        except (OSError, ProtocolError, ValueError):
            self.drop(member)
            return
        self.drop(member)

    def _handle(self, member: SocketMember, packet: bytes) -> None:
        kind, flag, number, time_ns = unpack_header(packet)
        if kind == PacketKind.HELLO and member.role is None:
            member.own_frames = bool(number)
            member.urgent = unpack_identifiers(packet[HEADER.size :])
            self._join(member, HubRole(flag))
        elif kind in (PacketKind.SEND, PacketKind.IDLE) and member.role is not None:
            now_ns = time.monotonic_ns() if self._realtime else self._now_ns
            frames = unpack_frames(packet)
            waits_ns = () if time_ns == FOREVER_NS else (time_ns,)
            last_ns = max((*waits_ns, *(frame.time_ns for frame in frames)), default=0)
            if last_ns > now_ns + _LONGEST_WAIT_NS:
                raise protocol_violation(
                    f"a client waits or sends until {last_ns} ns, which is too far in the future"
                )
            if kind == PacketKind.SEND:
                for frame in frames:
                    self._queue(member, frame, now_ns)
            else:
                member.number = number
                self.begin_wait(member, frames, time_ns, on_frames=bool(flag))
        else:
            raise protocol_violation(f"unexpected packet of kind {kind}")

    def _queue(self, member: HubMember, frame: WireFrame, now_ns: int) -> None:
        source, faults = (member.key, frame.port), self._faults
        if self._realtime and member.role == HubRole.DEVICE and frame.time_ns:
            now_ns = max(now_ns - _LONGEST_AGO_NS, min(now_ns, frame.time_ns))
        if faults is None:
            self._wire.queue(source, frame, now_ns)
            return
        from_master = member.role == HubRole.MASTER
        for each, spoiled in faults.take(source, frame, now_ns, from_master=from_master):
            self._wire.queue(each, spoiled, now_ns)
        if faults.bus_off:
            faults.bus_off = False
            self._send_to_masters(WireFrame(now_ns, _BUS_OFF, 8, 0, bytes(8)))
        if faults.unplugged:
            faults.unplugged = False
            for each_member in [*self._members.values()]:
                if each_member.role == HubRole.MASTER:
                    self.drop(each_member)

    def _send_to_masters(self, frame: WireFrame) -> None:
        """Send every master an error frame from its adapter, without transmission on the bus."""
        for member in self._members.values():
            if member.role == HubRole.MASTER:
                member.inbox.append(frame)
                if member.on_frames:
                    member.due_ns = min(member.due_ns, frame.time_ns)

    def _join(self, member: HubMember, role: HubRole) -> None:
        now_ns = time.monotonic_ns() if self._realtime else self._now_ns
        if role == HubRole.MASTER and self._faults and now_ns < self._faults.unplugged_until_ns:
            self.drop(member)
            return
        member.role = role
        if role == HubRole.MASTER and not self._realtime and not self._masters:
            self._joining.append(member)
            return
        self._masters += role == HubRole.MASTER
        self._welcome(member)

    def _welcome(self, member: HubMember) -> None:
        if member.role != HubRole.OBSERVER and not self._realtime:
            self._timed.append(member)
            member.idle = False
            self._busy += 1
        member.inbox.clear()
        self._send_inbox(member, PacketKind.WELCOME, flag=not self._realtime)

    def drop(self, member: HubMember) -> None:
        """Disconnect a client."""
        if self._members.pop(member.key, None) is None:
            return
        member.close()
        if isinstance(member, SocketMember):
            self._sockets.remove(member)
        if member in self._joining:
            self._joining.remove(member)
            return
        if member in self._timed:
            self._timed.remove(member)
            if not member.idle:
                self._busy -= 1
            if member.role == HubRole.MASTER:
                self._masters -= 1
                if not self._masters:
                    back_ns = self._faults.unplugged_until_ns if self._faults else 0
                    self._horizon_ns = max(self._now_ns + AFTER_RUN_NS, back_ns)
                    self._masterless_pace.begin(time.monotonic_ns(), self._now_ns)
