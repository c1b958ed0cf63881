"""Folders of simulated buses and ports, and the paths that belong to a channel's name."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from config.errors import TransportError
from config.process.private_folder import changeable_by_others, private_folder_problem

_SOCKET_PATH_BYTES = 107
_IN_USE = "in-use"


def runtime_directory() -> Path:
    """Return this user's folder for simulated buses; create it if necessary, closed to other users.

    The folder is ``$XDG_RUNTIME_DIR/rid-daq``, or ``/tmp/rid-daq-<user id>`` if the variable is not
    set.

    Raises:
        TransportError: The folder belongs to another user or is open to others, so that a bus in it
            could be theirs.
    """
    base = os.environ.get("XDG_RUNTIME_DIR")
    if base and Path(base).is_dir():
        directory = Path(base) / "rid-daq"
    else:
        directory = Path("/tmp") / f"rid-daq-{os.getuid()}"
    try:
        directory.mkdir(mode=0o700, exist_ok=True)
        problem = private_folder_problem(directory) or changeable_by_others(directory.parent)
    except OSError as error:
        raise TransportError(
            f"{directory}: cannot create the folder for sockets ({error})", code="RID-SOCKET-PATH"
        ) from None
    if problem:
        raise TransportError(f"{directory}: {problem}", code="RID-RUNTIME-NOT-PRIVATE")
    return directory


@contextlib.contextmanager
def private_folder(name: str) -> Iterator[Path]:
    """Yield a new folder for one bus, and remove it at the end.

    First, folders are removed that were left behind because all their processes were killed.

    Raises:
        TransportError: As `runtime_directory`, or the folder cannot be created.
    """
    runtime = runtime_directory()
    with contextlib.ExitStack() as stack:
        try:
            with _exclusive_lock(runtime):
                for folder in runtime.iterdir():
                    _remove_unused(folder)
                folder = Path(tempfile.mkdtemp(prefix=f"{name}-", dir=runtime))
                stack.callback(shutil.rmtree, folder, ignore_errors=True)
                (folder / _IN_USE).touch(mode=0o600)
                stack.enter_context(folder_in_use(folder))
        except OSError as error:
            raise TransportError(
                f"{runtime}: cannot create a folder for the bus there ({error})",
                code="RID-SOCKET-PATH",
            ) from None
        yield folder


@contextlib.contextmanager
def folder_in_use(folder: Path) -> Iterator[None]:
    """Mark a private folder as used, so that it is not removed.

    Every process that serves in the folder uses this context.

    Raises:
        OSError: The folder no longer exists.
    """
    descriptor = os.open(folder / _IN_USE, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH)
        yield
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def _exclusive_lock(runtime: Path) -> Iterator[None]:
    """Lock the creation and removal of private folders."""
    descriptor = os.open(runtime, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _remove_unused(folder: Path) -> None:
    """Remove a private folder that no process uses."""
    with contextlib.suppress(OSError):  # a file, or in use, or already removed
        folder.rmdir()  # empty folder of a process that was killed early
    with contextlib.suppress(OSError):
        descriptor = os.open(folder / _IN_USE, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(folder, ignore_errors=True)
        finally:
            os.close(descriptor)


def socket_path(channel: str) -> Path:
    """Return the socket of a channel: a path unchanged, a plain name in `runtime_directory`.

    Raises:
        TransportError: The path is too long for a socket.
    """
    path = Path(channel) if os.sep in channel else runtime_directory() / f"{channel}.sock"
    if len(os.fsencode(path)) > _SOCKET_PATH_BYTES:
        raise TransportError(
            f"{path}: the path is longer than {_SOCKET_PATH_BYTES} bytes, the limit for sockets;"
            " choose a shorter folder",
            code="RID-SOCKET-PATH",
        )
    return path


def plate_path(channel: str) -> Path:
    """Return the path of the plate's serial port next to a channel.

    Raises:
        TransportError: As `socket_path`.
    """
    return socket_path(channel).with_suffix(".plate")


def registers_path(channel: str) -> Path:
    """Return the path of the serial line of the drives' registers next to a channel."""
    return socket_path(channel).with_suffix(".drives")


def axes_path(channel: str) -> Path:
    """Return the path of the file with the true state of the axes next to a channel."""
    return socket_path(channel).with_suffix(".axes")
