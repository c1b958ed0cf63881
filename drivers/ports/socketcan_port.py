"""`SocketCanPort`: an interface of Linux's SocketCAN as a raw socket, without python-can.

The kernel stamps each frame with its arrival time, so a late read does not change this time. The
kernel also counts dropped frames. The send buffer holds the frames of about one cycle, so that no
set-point can wait in it and take effect much later.
"""

from __future__ import annotations

import errno
import select
import socket
import struct
import time
from collections.abc import Sequence

from config.errors import TransportError
from drivers.ports.can_ports import Arrival, refuse_bus_off

RECEIVE_BUFFER_BYTES = 4 << 20
SEND_BUFFER_BYTES = 20 << 10
"""Size of the send buffer [bytes]. It holds about 25 frames, enough for a cycle of sixteen axes:
the kernel counts about 800 bytes per frame."""

SIMULTANEOUS_NS = 20_000
"""Longest time between the readings of two clocks that count as simultaneous [ns]."""

ERROR_FLAG, REMOTE_FLAG, EXTENDED_FLAG = 0x2000_0000, 0x4000_0000, 0x8000_0000

_FRAME = struct.Struct("=IB3x8s")
_TIME = struct.Struct("@qq")
_COUNT = struct.Struct("@I")
_SO_RCVBUFFORCE, _SO_TIMESTAMPNS, _SO_RXQ_OVFL = 33, 35, 40
_SOL_CAN_RAW, _CAN_RAW_ERR_FILTER = 101, 2
_ERROR_CLASSES = 0x1FFF_FFFF
_CONTROLLER, _CONTROLLER_OVERFLOW = 0x004, 0x01
_ANCILLARY_BYTES = socket.CMSG_SPACE(_TIME.size) + socket.CMSG_SPACE(_COUNT.size)
_MOST_FRAMES = 1024
_QUEUE_FULL = (errno.EAGAIN, errno.ENOBUFS)
_TRIES = 5


def both_clocks() -> tuple[int, int]:
    """Return CLOCK_REALTIME and CLOCK_MONOTONIC [ns], read within 20 us if the load permits."""
    for _ in range(_TRIES):
        before_ns = time.monotonic_ns()
        date_ns, now_ns = time.time_ns(), time.monotonic_ns()
        if now_ns - before_ns < SIMULTANEOUS_NS:
            return date_ns, now_ns
    return time.time_ns(), time.monotonic_ns()


class KernelStamps:
    """Conversion of the kernel's time stamps to CLOCK_MONOTONIC, even if the date is changed.

    The kernel stamps frames with CLOCK_REALTIME (the date). Its difference from CLOCK_MONOTONIC is
    constant until someone sets the date; slewing affects both clocks. After a change of the date, a
    frame may have been stamped with the old date or with the new one. The correct date is the one
    that gives an arrival between the previous read and this one. If the date was changed by less
    than the time between two reads, both dates are possible, and the arrival time may be wrong by
    the amount of the change.

    Args:
        date_ns, now_ns: CLOCK_REALTIME and CLOCK_MONOTONIC [ns], as in `look`.
    """

    def __init__(self, date_ns: int, now_ns: int) -> None:
        self._last_ns = self._now_ns = now_ns
        self._ahead_ns = self._was_ahead_ns = date_ns - now_ns

    def look(self, date_ns: int, now_ns: int) -> None:
        """Store the present times of both clocks [ns], just before frames are read."""
        self._was_ahead_ns, self._ahead_ns = self._ahead_ns, date_ns - now_ns
        self._now_ns = now_ns

    def arrival_s(self, stamp_ns: int) -> float:
        """Return the arrival time of a frame that has just been read [s, CLOCK_MONOTONIC]."""
        last_ns, now_ns = self._last_ns, self._now_ns
        arrived_ns = stamp_ns - self._ahead_ns
        if not last_ns <= arrived_ns <= now_ns:
            by_the_date_before_ns = stamp_ns - self._was_ahead_ns
            if last_ns <= by_the_date_before_ns <= now_ns:
                arrived_ns = by_the_date_before_ns
        return min(max(arrived_ns, last_ns), now_ns) * 1e-9

    def all_read(self) -> None:
        """Store that all frames that arrived before the last `look` have been read."""
        self._last_ns = self._now_ns


class SocketCanPort:
    """A CAN interface such as can0; see `drivers.ports.can_ports.FramePort`.

    Args:
        channel: The interface's name.
        watch_errors: True to receive error frames; simulated devices do not need them, because the
            master evaluates them.

    Attributes:
        channel_info: Name of the bus in messages.
        lost_frames: Number of frames that the kernel dropped because they were not read in time,
            plus the number of overflows that the controller reported.
        takes_remote_frames: True to return remote frames too, marked by `REMOTE_FLAG`; simulated
            devices need them.
        error_frames: Number of error frames (error-passive, arbitration lost, ...); bus-off raises
            an error.

    Raises:
        OSError: The interface does not exist.
    """

    time_stamped = True

    def __init__(self, channel: str, *, watch_errors: bool = True) -> None:
        self.channel_info = f"socketcan {channel}"
        self.lost_frames = 0
        self.error_frames = 0
        self.takes_remote_frames = False
        self._dropped = 0
        self._stamps = KernelStamps(*both_clocks())
        self._socket = self._open(channel, watch_errors)
        self._socket.setblocking(False)

    def _open(self, channel: str, watch_errors: bool) -> socket.socket:
        own = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        try:
            self._set_options(own, watch_errors)
            own.bind((channel,))
        except BaseException:
            own.close()
            raise
        return own

    def _set_options(self, own: socket.socket, watch_errors: bool) -> None:
        try:
            own.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, RECEIVE_BUFFER_BYTES)
        except PermissionError:  # without CAP_NET_ADMIN: at most net.core.rmem_max
            own.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        own.setsockopt(
            socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES // 2
        )  # the kernel doubles the value
        own.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        own.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)
        if watch_errors:
            own.setsockopt(_SOL_CAN_RAW, _CAN_RAW_ERR_FILTER, _ERROR_CLASSES)

    def fileno(self) -> int:
        """Return the socket's descriptor."""
        return self._socket.fileno()

    def send_frames(self, frames: Sequence[tuple[int, bytes | bytearray]]) -> None:
        """Send frames; see `FramePort`. No frame waits for room in the transmit queue.

        Raises:
            TransportError: The transmit queue is full: no node acknowledges, or the cable is off.
        """
        failed: OSError | None = None
        send = self._socket.send
        for cob_id, data in frames:
            try:
                send(_FRAME.pack(cob_id, len(data), data))
            except OSError as error:
                failed = failed or error
        if failed is None:
            return
        if failed.errno in _QUEUE_FULL:
            raise TransportError(
                f"CAN bus {self.channel_info}: the transmit queue is full, frames are not sent;"
                " check that the drives are powered, the cable, and the termination",
                code="RID-CAN-LOST",
            ) from failed
        raise failed

    def receive_frames(self, timeout_s: float) -> Sequence[Arrival] | None:
        """Return all frames that have arrived; see `FramePort`."""
        if not select.select([self._socket], [], [], max(timeout_s, 0.0))[0]:
            return None
        date_ns, now_ns = both_clocks()
        self._stamps.look(date_ns, now_ns)
        arrived: list[Arrival] = []
        receive = self._socket.recvmsg
        try:
            for _ in range(_MOST_FRAMES):
                data, ancillary, _, _ = receive(_FRAME.size, _ANCILLARY_BYTES)
                can_id, length, payload = _FRAME.unpack(data)
                time_s = self._note(ancillary, now_ns)
                if can_id < 0x800:
                    arrived.append(Arrival(can_id, payload[:length], time_s))
                elif self.takes_remote_frames and can_id ^ REMOTE_FLAG < 0x800:
                    arrived.append(Arrival(can_id, bytes(length), time_s))
                elif can_id & ERROR_FLAG:
                    self._error_frame(can_id, payload)
        except BlockingIOError:
            self._stamps.all_read()
        return arrived

    def _note(self, ancillary: list[tuple[int, int, bytes]], now_ns: int) -> float:
        """Count dropped frames; return the frame's arrival time on CLOCK_MONOTONIC [s]."""
        time_s = now_ns * 1e-9
        for _, kind, value in ancillary:
            if kind == _SO_TIMESTAMPNS:
                seconds, nanoseconds = _TIME.unpack(value)
                time_s = self._stamps.arrival_s(seconds * 1_000_000_000 + nanoseconds)
            elif kind == _SO_RXQ_OVFL:
                (dropped,) = _COUNT.unpack(value)
                self.lost_frames += (dropped - self._dropped) & 0xFFFF_FFFF
                self._dropped = dropped
        return time_s

    def _error_frame(self, can_id: int, payload: bytes) -> None:
        self.error_frames += 1
        if can_id & _CONTROLLER and payload[1] & _CONTROLLER_OVERFLOW:
            self.lost_frames += 1
        refuse_bus_off(can_id & _ERROR_CLASSES, self.channel_info)

    def shutdown(self) -> None:
        """Close the socket."""
        self._socket.close()
