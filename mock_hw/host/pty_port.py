"""`PtyPort`: a serial port of a simulated device: a pseudo-terminal at a fixed path."""

from __future__ import annotations

import os
import select
import termios
import tty
from pathlib import Path

from config.errors import TransportError

_READ_BYTES = 4096
_PATIENCE_S = 5.0
"""Longest wait for a reader that does not read, if simulated time waits for it [s]; then bytes are
lost."""

UNKNOWN_RATE = -1
"""Value of `baud_rate` if it is not one of the standard rates in `termios`, or if the port is
unplugged."""

_RATES = {
    getattr(termios, name): int(name[1:])
    for name in dir(termios)
    if name[0] == "B" and name[1:].isdigit()
}


class PtyPort:
    """A pseudo-terminal with a symbolic link at `path`; the constructor plugs it in.

    Bytes are lost if no program has the port open, as on a real line, or if the program reads too
    slowly.

    Args:
        path: Path at which programs open the port.
        patient: True to wait for a slow reader; simulated time waits too. False to discard bytes
            that do not fit.

    Attributes:
        passed_bytes: Number of bytes that were delivered.
        lost_bytes: Number of bytes that were lost because the program did not read them in time.

    Raises:
        TransportError: The path already exists, or no pseudo-terminal is available.
    """

    def __init__(self, path: Path, *, patient: bool) -> None:
        self._path = path
        self._patient = patient
        self._fd = -1
        self.passed_bytes = 0
        self.lost_bytes = 0
        self.plug()

    def fileno(self) -> int:
        """Return the file descriptor to wait for; -1 while unplugged."""
        return self._fd

    @property
    def has_listener(self) -> bool:
        """True if a program has the port open."""
        if self._fd < 0:
            return False
        poll = select.poll()
        poll.register(self._fd, select.POLLOUT)
        return not any(event & select.POLLHUP for _, event in poll.poll(0))

    @property
    def baud_rate(self) -> int:
        """Baud rate that the program has set."""
        if self._fd < 0:
            return UNKNOWN_RATE
        return _RATES.get(termios.tcgetattr(self._fd)[5], UNKNOWN_RATE)

    def plug(self) -> None:
        """Create the port.

        Raises:
            TransportError: The path already exists, or no pseudo-terminal is available.
        """
        if self._fd >= 0:
            return
        try:
            self._fd, other = os.openpty()
            try:
                tty.setraw(other)  # no echoes before a program sets its mode
                self._path.symlink_to(os.ttyname(other))
            finally:
                os.close(other)  # a hang-up then shows that no program has the port open
            os.set_blocking(self._fd, False)
        except OSError as error:
            self._close()
            raise TransportError(
                f"{self._path}: cannot create a serial port here ({error})",
                code="RID-SOCKET-PATH",
            ) from None

    def unplug(self) -> None:
        """Remove the port, even if a program has it open."""
        if self._fd >= 0:
            self._path.unlink(missing_ok=True)
            self._close()

    def read(self) -> bytes:
        """Return the received bytes; empty if no bytes have arrived."""
        if self._fd < 0:
            return b""
        try:
            return os.read(self._fd, _READ_BYTES)
        except OSError:  # no bytes, or no program has the port open
            return b""

    def write(self, data: bytes) -> None:
        """Send bytes to the program that has the port open."""
        view = memoryview(data)
        while view and self.has_listener:
            try:
                written = os.write(self._fd, view)
                view = view[written:]
                self.passed_bytes += written
            except BlockingIOError:
                if not (self._patient and self._becomes_writable()):
                    self.lost_bytes += len(view)
                    return
            except OSError:
                return

    def _becomes_writable(self) -> bool:
        poll = select.poll()
        poll.register(self._fd, select.POLLOUT)
        return bool(poll.poll(1000.0 * _PATIENCE_S))

    def _close(self) -> None:
        if self._fd >= 0:
            os.close(self._fd)
        self._fd = -1

    close = unplug
