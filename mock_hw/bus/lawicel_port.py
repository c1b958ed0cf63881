"""`LawicelPort`: devices behind a simulated slcan adapter, which is a pseudo-terminal."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import select
import sys
import termios
import time
import tty
from collections.abc import Sequence
from pathlib import Path

from config.errors import TransportError
from drivers.ports.can_ports import Arrival
from mock_hw.bus.lawicel import AdapterFrame, LawicelAdapter
from mock_hw.bus.wire_time import REMOTE_FLAG, STANDARD_MASK

_READ_BYTES = 4096
_MEMORY_BYTES = 3072  # less than the 4 kB that the terminal holds and can discard


class LawicelPort:
    """CAN bus of the simulated devices behind the adapter; a `drivers.ports.can_ports.FramePort`.

    This process keeps the computer's end of the pseudo-terminal open too, so that programs can
    connect and disconnect. Bytes that a program has not read are discarded when it opens or closes
    the channel.

    Args:
        path: Path at which programs open the adapter; a symbolic link to the pseudo-terminal is
            created there.
        bit_rate: Bit rate of the bus [bit/s].

    Raises:
        TransportError: The path already exists, or no pseudo-terminal is available.
    """

    time_stamped = False

    def __init__(self, path: Path, bit_rate: int) -> None:
        self.channel_info = f"slcan adapter {path}"
        self._path = path
        self._adapter = LawicelAdapter(bit_rate, lambda: time.monotonic_ns() // 1_000_000)
        try:
            self._fd, self._other = os.openpty()
            try:
                tty.setraw(self._other)
                path.symlink_to(os.ttyname(self._other))
            except BaseException:
                os.close(self._fd)
                os.close(self._other)
                raise
        except OSError as error:
            raise TransportError(
                f"{path}: cannot create an slcan adapter here ({error})", code="RID-SOCKET-PATH"
            ) from None
        os.set_blocking(self._fd, False)
        self._unsent = b""
        self._poll = select.poll()
        self._poll.register(self._fd, select.POLLIN)

    def fileno(self) -> int:
        """Return the file descriptor to wait for."""
        return self._fd

    def send_frames(self, frames: Sequence[tuple[int, bytes | bytearray]]) -> None:
        """Send frames of the devices to the computer; they are lost if it reads too slowly."""
        encode = self._adapter.encode
        self._write(
            b"".join(
                encode(AdapterFrame(cob_id, len(data), bytes(data))) for cob_id, data in frames
            )
        )

    def receive_frames(self, timeout_s: float) -> Sequence[Arrival] | None:
        """Return the computer's standard frames; None if no byte comes within `timeout_s` [s]."""
        self._write(b"")
        if not self._poll.poll(max(timeout_s, 0.0) * 1000.0):
            return None
        was_open = self._adapter.open
        answers, frames = self._adapter.feed(os.read(self._fd, _READ_BYTES))
        if was_open != self._adapter.open:
            self._unsent = b""
            termios.tcflush(self._other, termios.TCIFLUSH)
        self._write(answers)
        return [
            Arrival(frame.can_id, frame.data or bytes(frame.length), time.monotonic())
            for frame in frames
            if frame.can_id & ~REMOTE_FLAG <= STANDARD_MASK
        ]

    def shutdown(self) -> None:
        """Unplug the adapter."""
        self._path.unlink(missing_ok=True)
        os.close(self._other)
        os.close(self._fd)

    def _write(self, data: bytes) -> None:
        """Write lines to the computer; lose them if the adapter's memory is full.

        The kernel may accept only a part of the bytes, or none, even if they fit. The rest is sent
        with the next call.
        """
        if data and len(self._unsent) + len(data) + _unread_bytes(self._other) > _MEMORY_BYTES:
            self._adapter.overrun = True
        else:
            self._unsent += data
        if self._unsent:
            with contextlib.suppress(BlockingIOError):
                self._unsent = self._unsent[os.write(self._fd, self._unsent) :]


def _unread_bytes(descriptor: int) -> int:
    """Return the number of bytes that the program at the terminal has not read.

    It is 0 if Linux's slcan driver is the reader: it reads all bytes immediately, and its line
    discipline does not support this request.
    """
    try:
        count = fcntl.ioctl(descriptor, termios.FIONREAD, bytes(4))
    except OSError as error:
        if error.errno != errno.ENOTTY:
            raise
        return 0
    return int.from_bytes(count, sys.byteorder)
