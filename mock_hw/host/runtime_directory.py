"""Folders and paths of the sockets, ports and files of simulated cells."""

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
    """Return the user's folder for simulated buses; create it without access for other users.

    The folder is ``$XDG_RUNTIME_DIR/rid-daq``, or ``/tmp/rid-daq-<user id>`` if the variable does
    not name a folder.

    Raises:
        TransportError: The folder cannot be created; or it belongs to another user, or other users
            can access or replace it, so that a bus in it could be another user's.
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
    """Yield a new private folder for one bus; remove it at the end.

    Before that, old private folders are removed whose processes were all killed.

    Raises:
        TransportError: As for `runtime_directory`, or the folder cannot be created.
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
                f"{runtime}: cannot create a folder for the bus in this folder ({error})",
                code="RID-SOCKET-PATH",
            ) from None
        yield folder


@contextlib.contextmanager
def folder_in_use(folder: Path) -> Iterator[None]:
    """Mark a private folder as used, so that no other process removes it.

    Every process with a socket or a port in the folder uses this context.

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
    """Lock the runtime folder while private folders are created or removed in it."""
    descriptor = os.open(runtime, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _remove_unused(folder: Path) -> None:
    """Remove a private folder that no process uses."""
    with contextlib.suppress(OSError):  # not a folder, not empty, or already removed
        folder.rmdir()  # of a process that was killed before it used the folder
    with contextlib.suppress(OSError):
        descriptor = os.open(folder / _IN_USE, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(folder, ignore_errors=True)
        finally:
            os.close(descriptor)


def socket_path(channel: str) -> Path:
    """Return a channel's socket: `channel` if it is a path; for a name, one in the runtime folder.

    Raises:
        TransportError: The path is too long for a socket, or as for `runtime_directory`.
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
    """Return the path of the plate amplifier's serial port for a channel.

    Raises:
        TransportError: As for `socket_path`.
    """
    return socket_path(channel).with_suffix(".plate")


def registers_path(channel: str) -> Path:
    """Return the path of the serial port of the drives' registers for a channel.

    Raises:
        TransportError: As for `socket_path`.
    """
    return socket_path(channel).with_suffix(".drives")


def axes_path(channel: str) -> Path:
    """Return the path of the file with the true state of the axes for a channel.

    Raises:
        TransportError: As for `socket_path`.
    """
    return socket_path(channel).with_suffix(".axes")
