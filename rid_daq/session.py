"""A session: the runs' folder, and the lock that keeps a second session off the same bus."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from acquisition.run_folder import RunFolder, RunStatus
from config.cell import CellConfig
from config.errors import LockedError, RecordingError, RidDaqError
from rid_daq.running_sessions import machine_lock_folders

RunsFolder = Annotated[
    Path, typer.Option("--runs", help="The folder that holds the run folders.", show_default=True)
]
"""The `--runs` option that every command with run folders has."""

DEFAULT_RUNS = Path("runs")


@contextlib.contextmanager
def hold_cell(cell: CellConfig, folder: Path | None = None) -> Iterator[None]:
    """Hold a cell's bus alone for as long as the `with` lasts.

    The lock belongs to the operating system: it ends with this process, however that ends.

    Parameters
    ----------
    cell
        The cell whose bus (interface and channel) nobody else may command meanwhile.
    folder
        Where lock files live. Unless told, the machine's lock folder, and for a simulated bus
        the folder that its socket is in.

    Raises
    ------
    LockedError
        Another session holds the bus; the message says which.
    RecordingError
        The lock file cannot be written.
    """
    path = _lock_path(cell, folder or lock_folder(cell))
    descriptor = _open_lock(path)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(descriptor, 200, 0).decode("utf-8", "replace").partition("\n")[0]
            raise LockedError(
                f"cell {cell.name}: bus {cell.can.interface}:{cell.can.channel} is held by another"
                f" session ({holder or 'of another user'}). Wait until it ends, or stop it:"
                " `rid-daq stop`."
            ) from None
        _sign(descriptor, cell)
        yield
    finally:
        os.close(descriptor)


def as_label(text: str) -> str:
    """Return text, such as a file's name, as a run's label may be."""
    return re.sub(r"[^\w .-]", "_", text)[:64] or "run"


@contextlib.contextmanager
def unfinished(folder: RunFolder) -> Iterator[None]:
    """Mark a run as stopped, with the reason, where the `with` is left by an error or a signal."""
    try:
        yield
    except BaseException as error:
        told = isinstance(error, RidDaqError)
        why = str(error) if told else "interrupted, or failed by itself"
        with contextlib.suppress(RidDaqError):
            folder.finish(RunStatus.STOPPED, {"why": why})
        raise


def lock_folder(cell: CellConfig) -> Path:
    """Return where the lock of a cell's bus lives."""
    if cell.can.interface == "rid_sim":
        from mock_hw.runtime_directory import socket_path

        return socket_path(cell.can.channel).parent
    return machine_lock_folders()[0]


def _lock_path(cell: CellConfig, folder: Path) -> Path:
    bus = f"{cell.can.interface}:{cell.can.channel}"
    words = re.sub(r"[^\w.-]", "_", bus)[-40:]
    return folder / f"rid-daq-{words}-{hashlib.sha256(bus.encode()).hexdigest()[:8]}.lock"


def _open_lock(path: Path) -> int:
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o644)
    except PermissionError:
        # Another user's file: it cannot be signed, but it can be locked.
        with contextlib.suppress(OSError):
            return os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
        raise RecordingError(f"{path}: cannot open the lock file; is it yours?") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot open the lock file: {error.strerror}") from None


def _sign(descriptor: int, cell: CellConfig) -> None:
    with contextlib.suppress(OSError):
        os.ftruncate(descriptor, 0)
        command = " ".join(("rid-daq", *(Path(word).name for word in sys.argv[1:3])))
        text = f"process {os.getpid()}: {command}\ncell {cell.name}\n"
        os.pwrite(descriptor, text.encode(), 0)
