"""`PtyPort`: the device's end of a serial port that is a pseudo-terminal, at a path that stays."""

from __future__ import annotations

import os
import select
import termios
import tty
from pathlib import Path

from config.errors import TransportError

_READ_BYTES = 4096
_PATIENCE_S = 5.0
"""How long a reader that has the port open may not read before its bytes are dropped."""

UNKNOWN_RATE = -1
"""A baud rate that has no constant of its own, as a computer may well set."""

_RATES = {
    getattr(termios, name): int(name[1:])
    for name in dir(termios)
    if name[0] == "B" and name[1:].isdigit()
}


class PtyPort:
    """A pseudo-terminal with a link to it at `path`; plugged in when made.

    Nobody's listening loses bytes, as on a real line; so does a reader that lets them pile up.

    Args:
        path: Where computers open it.
        patient: Whether to wait for a reader that has the port open but is slower than this: with
            simulated time, which waits too. Otherwise what does not fit is lost.

    Attributes:
        passed_bytes: How many bytes were handed over.
        lost_bytes: How many bytes a listening reader did not fetch in time.

    Raises:
        TransportError: There is something at `path` already, or no pseudo-terminal can be had.
    """

    def __init__(self, path: Path, *, patient: bool) -> None:
        self._path = path
        self._patient = patient
        self._fd = -1
        self.passed_bytes = 0
        self.lost_bytes = 0
        self.plug()

    def fileno(self) -> int:
        """Return the descriptor to wait at; -1 while unplugged."""
        return self._fd

    @property
    def listened(self) -> bool:
        """Whether somebody has the port open."""
        if self._fd < 0:
            return False
        poll = select.poll()
        poll.register(self._fd, select.POLLOUT)
        return not any(event & select.POLLHUP for _, event in poll.poll(0))

    @property
    def baud_rate(self) -> int:
        """The rate that the computer has set."""
        if self._fd < 0:
            return UNKNOWN_RATE
        return _RATES.get(termios.tcgetattr(self._fd)[5], UNKNOWN_RATE)

    def plug(self) -> None:
        """Make the port appear."""
        if self._fd >= 0:
            return
        try:
            self._fd, other = os.openpty()
            try:
                tty.setraw(other)  # nothing is echoed before a computer has set its own mode
                self._path.symlink_to(os.ttyname(other))
            finally:
                os.close(other)  # from now on a hang-up tells that nobody listens
            os.set_blocking(self._fd, False)
        except OSError as error:
            self._close()
            raise TransportError(
                f"{self._path}: cannot make a serial port here ({error})",
                code="RID-SOCKET-PATH",
            ) from None

    def unplug(self) -> None:
        """Let the port disappear, under whoever has it open."""
        if self._fd >= 0:
            self._path.unlink(missing_ok=True)
            self._close()

    def read(self) -> bytes:
        """Return what has come; nothing where nobody listens."""
        if self._fd < 0:
            return b""
        try:
            return os.read(self._fd, _READ_BYTES)
        except OSError:  # nothing there, or nobody
            return b""

    def write(self, data: bytes) -> None:
        """Send bytes to whoever listens."""
        view = memoryview(data)
        while view and self.listened:
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
