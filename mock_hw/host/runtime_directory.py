"""Where simulated buses and ports live, and how a channel's name becomes a path there."""

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
    """Return this user's folder for simulated buses, made if need be and closed to others.

    It is ``$XDG_RUNTIME_DIR/rid-daq``, or ``/tmp/rid-daq-<user id>`` where that is not set.

    Raises:
        TransportError: The folder belongs to somebody else or is open to others: a bus there could
            be theirs.
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
            f"{directory}: cannot make the folder for sockets ({error})", code="RID-SOCKET-PATH"
        ) from None
    if problem:
        raise TransportError(f"{directory}: {problem}", code="RID-RUNTIME-NOT-PRIVATE")
    return directory


@contextlib.contextmanager
def private_folder(name: str) -> Iterator[Path]:
    """Yield a new folder for one bus, which is removed at the end.

    Before, folders are removed whose processes were all killed at once.

    Raises:
        TransportError: As `runtime_directory`; or the folder cannot be made.
    """
    runtime = runtime_directory()
    with contextlib.ExitStack() as stack:
        try:
            with _alone_in(runtime):
                for folder in runtime.iterdir():
                    _remove_unserved(folder)
                folder = Path(tempfile.mkdtemp(prefix=f"{name}-", dir=runtime))
                stack.callback(shutil.rmtree, folder, ignore_errors=True)
                (folder / _IN_USE).touch(mode=0o600)
                stack.enter_context(folder_in_use(folder))
        except OSError as error:
            raise TransportError(
                f"{runtime}: cannot make a bus's folder there ({error})", code="RID-SOCKET-PATH"
            ) from None
        yield folder


@contextlib.contextmanager
def folder_in_use(folder: Path) -> Iterator[None]:
    """Keep a private folder from being removed as left over; each process that serves there does.

    Raises:
        OSError: It is gone.
    """
    descriptor = os.open(folder / _IN_USE, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH)
        yield
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def _alone_in(runtime: Path) -> Iterator[None]:
    """Let nobody else make or remove private folders meanwhile."""
    descriptor = os.open(runtime, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _remove_unserved(folder: Path) -> None:
    """Remove a private folder that no process uses."""
    with contextlib.suppress(OSError):  # a file, or in use, or already gone
        folder.rmdir()  # one whose maker was killed before it could say that it is in use
    with contextlib.suppress(OSError):
        descriptor = os.open(folder / _IN_USE, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(folder, ignore_errors=True)
        finally:
            os.close(descriptor)


def socket_path(channel: str) -> Path:
    """Return the socket of a channel: a path as it is, a plain name in `runtime_directory`.

    Raises:
        TransportError: The path is longer than a socket's may be.
    """
    path = Path(channel) if os.sep in channel else runtime_directory() / f"{channel}.sock"
    if len(os.fsencode(path)) > _SOCKET_PATH_BYTES:
        raise TransportError(
            f"{path}: longer than the {_SOCKET_PATH_BYTES} bytes of a socket's path;"
            " choose a shorter folder",
            code="RID-SOCKET-PATH",
        )
    return path


def plate_path(channel: str) -> Path:
    """Return the serial port of the plate that is served beside a channel.

    Raises:
        TransportError: As `socket_path`.
    """
    return socket_path(channel).with_suffix(".plate")


def registers_path(channel: str) -> Path:
    """Return the serial line that the drives' registers are served on beside a channel."""
    return socket_path(channel).with_suffix(".drives")


def axes_path(channel: str) -> Path:
    """Return where the true state of the axes is that are served at a channel."""
    return socket_path(channel).with_suffix(".axes")
