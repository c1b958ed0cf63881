"""Unix sockets through which programs on this computer reach the services of this user."""

from __future__ import annotations

import contextlib
import hashlib
import os
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from rid_daq.web.access import is_loopback

BACKLOG: Final = 128
_ENDING: Final = "service.sock"


def socket_path_of(folder: Path) -> Path:
    """Return the path of the socket of a folder's service; socket paths must be short."""
    from mock_hw.host.runtime_directory import runtime_directory

    digest = hashlib.sha256(str(folder.resolve()).encode()).hexdigest()[:12]
    return runtime_directory() / f"rid-daq-{digest}.{_ENDING}"


def local_sockets() -> list[Path]:
    """Return the sockets of the services that answer."""
    from mock_hw.host.runtime_directory import runtime_directory

    return [path for path in sorted(runtime_directory().glob(f"*.{_ENDING}")) if _answers(path)]


def is_this_computer(address: str) -> bool:
    """Return True if the host of a URL is a loopback address."""
    host = urlsplit(address).hostname or ""
    return host == "localhost" or is_loopback(host)


@contextlib.contextmanager
def local_listener(folder: Path) -> Iterator[tuple[socket.socket, Path]]:
    """Yield a listening socket that only this user can open, and its path; then remove the socket.

    A client that connects before the service answers waits and is not refused.
    """
    path = socket_path_of(folder)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        # a socket at this path is left by a killed service: this process holds the folder's lock
        path.unlink(missing_ok=True)
        mask = os.umask(0o177)
        try:
            listener.bind(str(path))
            listener.listen(BACKLOG)
        finally:
            os.umask(mask)
        try:
            yield listener, path
        finally:
            path.unlink(missing_ok=True)


def _answers(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as tried:
        try:
            tried.connect(str(path))
        except OSError:
            return False
    return True
