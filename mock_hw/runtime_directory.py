"""Where simulated buses and ports live, and how a channel's name becomes a path there."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from config.errors import TransportError

_SOCKET_PATH_BYTES = 107


def runtime_directory() -> Path:
    """Return this user's folder for simulated buses, made if need be and closed to others.

    It is ``$XDG_RUNTIME_DIR/rid-daq``, or ``/tmp/rid-daq-<user id>`` where that is not set.

    Raises
    ------
    TransportError
        The folder belongs to somebody else or is open to others: a bus there could be theirs.
    """
    base = os.environ.get("XDG_RUNTIME_DIR")
    if base and Path(base).is_dir():
        directory = Path(base) / "rid-daq"
    else:
        directory = Path("/tmp") / f"rid-daq-{os.getuid()}"
    try:
        directory.mkdir(mode=0o700, exist_ok=True)
        status = directory.lstat()
    except OSError as error:
        raise TransportError(f"{directory}: cannot make the folder for sockets ({error})") from None
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid():
        raise TransportError(f"{directory}: is not a folder of this user; remove it")
    if stat.S_IMODE(status.st_mode) & 0o077:
        raise TransportError(f"{directory}: is open to other users; run 'chmod 700 {directory}'")
    return directory


def socket_path(channel: str) -> Path:
    """Return the socket of a channel: a path as it is, a plain name in `runtime_directory`.

    Raises
    ------
    TransportError
        The path is longer than a socket's may be.
    """
    path = Path(channel) if os.sep in channel else runtime_directory() / f"{channel}.sock"
    if len(os.fsencode(path)) > _SOCKET_PATH_BYTES:
        raise TransportError(
            f"{path}: longer than the {_SOCKET_PATH_BYTES} bytes of a socket's path;"
            " choose a shorter folder"
        )
    return path


def plate_path(channel: str) -> Path:
    """Return the serial port of the plate that is served beside a channel.

    Raises
    ------
    TransportError
        As `socket_path`.
    """
    return socket_path(channel).with_suffix(".plate")


def registers_path(channel: str) -> Path:
    """Return the serial line that the drives' registers are served on beside a channel."""
    return socket_path(channel).with_suffix(".drives")
