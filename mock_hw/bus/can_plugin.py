"""`RidSimBus`: the simulated CAN bus as the interface ``rid_sim`` of python-can."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from config.errors import DriverError
from drivers.ports.can_ports import Arrival
from drivers.ports.python_can import can
from mock_hw.bus.arbitration import FOREVER_NS, WireFrame
from mock_hw.bus.embedded_master import EmbeddedMaster, find_hosted_hub
from mock_hw.bus.hub_client import HubClient
from mock_hw.bus.hub_protocol import OWN_PORT, HubRole
from mock_hw.bus.wire_time import (
    ERROR_FLAG,
    EXTENDED_FLAG,
    EXTENDED_MASK,
    REMOTE_FLAG,
    STANDARD_MASK,
)
from mock_hw.host.runtime_directory import socket_path

_POLLS_WITHOUT_TIME = 100
_POLL_NS = 1000
_LONGEST_WAIT_S = 1e9
_BUS_OFF = "the adapter is bus-off"


class LockstepClock:
    """Clock of a lock-step bus; time advances only while all its masters and devices wait."""

    def __init__(self, bus: RidSimBus) -> None:
        self._bus = bus

    def now_s(self) -> float:
        """Return the simulated time [s]."""
        return self._bus.now_ns * 1e-9

    def sleep_until(self, time_s: float) -> None:
        """Let simulated time advance to `time_s` [s]; store the frames that arrive until then."""
        if time_s > self.now_s():
            self._bus.sleep_until_ns(_nanoseconds(time_s))


class RidSimBus(can.BusABC):
    """A connection to a simulated bus: ``can.Bus(interface="rid_sim", channel="ir361")``.

    Args:
        channel: Name of a running simulated bus, or path of its socket.
        can_filters: Filters, as for every bus of python-can.
        participant: True to take part in lock-step, as the cell's master does: receive timeouts and
            time stamps are then in simulated time, which stands still while the program works.
            False for an observer, which never stops simulated time and waits in real time.
        receive_own_messages: True if `recv` also returns the messages that this bus has sent
            (`is_rx` False), after their transmission.

    Attributes:
        simulated_clock: Clock of the bus for a participant in lock-step; None in all other cases.

    Raises:
        can.CanInitializationError: No simulated bus runs on this channel.
    """

    time_stamped = True

    def __init__(
        self,
        channel: can.typechecking.Channel,
        can_filters: can.typechecking.CanFilters | None = None,
        *,
        participant: bool = False,
        receive_own_messages: bool = False,
        **kwargs: Any,
    ) -> None:
        del kwargs  # bit rate and such: the hub has its own
        try:
            path = socket_path(str(channel))
            self._client = _join_hub(path, participant, receive_own_messages)
        except DriverError as error:
            raise can.CanInitializationError(str(error)) from error
        self.channel_info = f"rid_sim {path}"
        self._inbox: deque[WireFrame] = deque()
        self._empty_polls = 0
        self.simulated_clock = LockstepClock(self) if self._client.lockstep else None
        simulated = self._client.simulated_time
        self._epoch_s = 0.0 if simulated else time.time() - time.monotonic()
        super().__init__(channel, can_filters)

    @property
    def now_ns(self) -> int:
        """Time at the end of the last wait [ns]; simulated time in lock-step."""
        return self._client.now_ns

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame; in lock-step it is transmitted during the caller's next wait.

        Raises:
            can.CanOperationError: The frame is not classic CAN, or the hub has ended.
        """
        if msg.is_fd or msg.is_error_frame:
            raise can.CanOperationError(
                "rid_sim: the bus supports classic data and remote frames only"
            )
        can_id = msg.arbitration_id
        if msg.is_extended_id:
            can_id |= EXTENDED_FLAG
        if msg.is_remote_frame:
            can_id |= REMOTE_FLAG
        try:
            client = self._client
            if isinstance(client, EmbeddedMaster) or client.lockstep:
                client.post(can_id, bytes(msg.data), msg.dlc)
            else:
                client.send(can_id, bytes(msg.data), msg.dlc)
        except DriverError as error:
            raise can.CanOperationError(str(error)) from error

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next frame that passes the filters, or None after `timeout` [s].

        Raises:
            can.CanOperationError: The hub has ended.
        """
        if timeout is None:
            until_ns = FOREVER_NS
        else:
            now_ns = self.now_ns if self._client.lockstep else time.monotonic_ns()
            until_ns = now_ns + _nanoseconds(max(timeout, 0.0))
        while True:
            while self._inbox:
                message = self._message(self._inbox.popleft())
                if self._filters is None or self._matches_filters(message):
                    self._empty_polls = 0
                    return message
            if self._has_expired(until_ns):
                return None
            try:
                self._inbox.extend(self._client.wait(until_ns))
                self._empty_polls = 0
            except DriverError as error:
                raise can.CanOperationError(str(error)) from error
            if not self._inbox and not self._client.lockstep and self.now_ns >= until_ns:
                return None

    def send_frames(self, frames: Sequence[tuple[int, bytes | bytearray]]) -> None:
        """Send classic data frames for the drivers, in real time as one packet to the hub.

        Raises:
            can.CanOperationError: The hub has ended.
        """
        client = self._client
        try:
            if isinstance(client, EmbeddedMaster) or client.lockstep:
                for cob_id, data in frames:
                    client.post(cob_id, bytes(data), len(data))
            else:
                client.send_all(frames)
        except DriverError as error:
            raise can.CanOperationError(str(error)) from error

    def receive_frames(self, timeout_s: float) -> Sequence[Arrival] | None:
        """Return all data frames with 11-bit identifiers that have arrived.

        The result is None if no frame arrives within `timeout_s` [s].

        Raises:
            can.CanOperationError: The hub has ended, or the adapter is bus-off.
        """
        if not self._client.lockstep:
            return self._receive_realtime(timeout_s)
        until_ns = self.now_ns + _nanoseconds(timeout_s)
        while not self._inbox:
            if self._has_expired(until_ns):
                return None
            try:
                self._inbox.extend(self._client.wait(until_ns))
            except DriverError as error:
                raise can.CanOperationError(str(error)) from error
        self._empty_polls = 0
        arrivals = [
            Arrival(frame.can_id, frame.data[: frame.length], frame.time_ns * 1e-9)
            for frame in self._inbox
            if frame.can_id <= STANDARD_MASK
        ]
        errors = any(frame.can_id & ERROR_FLAG for frame in self._inbox)
        self._inbox.clear()
        if errors:
            raise can.CanOperationError(_BUS_OFF)
        return arrivals

    def _receive_realtime(self, timeout_s: float) -> Sequence[Arrival] | None:
        assert isinstance(self._client, HubClient)
        try:
            frames = self._client.take_all(timeout_s)
        except DriverError as error:
            raise can.CanOperationError(str(error)) from error
        if not frames:
            return None
        if any(frame[1] & ERROR_FLAG for frame in frames):
            raise can.CanOperationError(_BUS_OFF)
        return [
            Arrival(can_id, data[:length], time_ns * 1e-9)
            for time_ns, can_id, length, _, data in frames
            if can_id <= STANDARD_MASK
        ]

    def sleep_until_ns(self, until_ns: int) -> None:
        """Let simulated time advance to `until_ns`.

        Raises:
            can.CanOperationError: The hub has ended.
        """
        if until_ns <= self.now_ns:
            return
        try:
            self._inbox.extend(self._client.wait(until_ns, on_frames=False))
        except DriverError as error:
            raise can.CanOperationError(str(error)) from error

    def shutdown(self) -> None:
        """Disconnect; frames that were already sent are still transmitted."""
        if not self._is_shutdown:
            super().shutdown()
            self._client.close()

    def fileno(self) -> int:
        """Return the socket's file descriptor for python-can's notifier; -1 in lock-step."""
        return -1 if self._client.lockstep else self._client.fileno()

    def _has_expired(self, until_ns: int) -> bool:
        """Return True if a lock-step deadline has passed, so that no frame can arrive until then.

        Simulated time stands still while the program works, so a program that polls without a
        timeout would stop time forever. Therefore every hundredth poll without a frame lets a
        microsecond pass.
        """
        if not self._client.lockstep or until_ns > self.now_ns:
            return False
        self._empty_polls += 1
        if self._empty_polls % _POLLS_WITHOUT_TIME == 0:
            self.sleep_until_ns(self.now_ns + _POLL_NS)
            return not self._inbox
        return True

    def _message(self, frame: WireFrame) -> can.Message:
        remote = bool(frame.can_id & REMOTE_FLAG)
        error = bool(frame.can_id & ERROR_FLAG)
        return can.Message(
            timestamp=frame.time_ns * 1e-9 + self._epoch_s,
            arbitration_id=frame.can_id & EXTENDED_MASK,
            is_extended_id=bool(frame.can_id & EXTENDED_FLAG),
            is_remote_frame=remote,
            is_error_frame=error,
            dlc=frame.length,
            data=None if remote else frame.data[: frame.length],
            is_rx=frame.port != OWN_PORT,
        )


def _join_hub(path: Path, participant: bool, own_frames: bool) -> HubClient | EmbeddedMaster:
    """Connect to a hub, by function calls if this process hosts it for masters."""
    if not participant:
        return HubClient(path, HubRole.OBSERVER, own_frames=own_frames)
    if (hosted := find_hosted_hub(path)) is not None:
        return EmbeddedMaster(hosted, own_frames=own_frames)
    return HubClient(path, HubRole.MASTER, own_frames=own_frames)


def _nanoseconds(time_s: float) -> int:
    return round(time_s * 1e9) if time_s < _LONGEST_WAIT_S else FOREVER_NS // 2
