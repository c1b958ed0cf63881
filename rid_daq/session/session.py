"""A session: the lock that keeps other sessions off a bus, and helpers for run folders."""

from __future__ import annotations

import contextlib
import hashlib
import re
from collections.abc import Iterator
from pathlib import Path

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import LATEST, RunStatus
from config.cell.cell import CellConfig
from config.errors import LockedError, RecordingError, RidDaqError
from config.process.file_locks import file_holder, held_file
from rid_daq.session.running_sessions import machine_lock_folders, registered_session, session_on


@contextlib.contextmanager
def hold_cell(cell: CellConfig, folder: Path | None = None) -> Iterator[None]:
    """Lock a cell's bus for this session inside the `with` block.

    The operating system releases the lock when this process ends, for any reason. `rid-daq stop`
    finds the session by a session file in the same folder.

    Args:
        cell: The cell whose bus (interface and channel) is locked.
        folder: Folder of lock files (default: the computer's lock folder; for a simulated bus, the
            folder of its socket).

    Raises:
        LockedError: Another session holds the bus; the message names it.
        RecordingError: The lock file cannot be opened, or the session file cannot be written.
        TransportError: The folder of a simulated bus cannot be used.
    """
    path = lock_path(cell, folder)
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(held_file(path))
        except BlockingIOError:
            raise LockedError(
                f"cell {cell.name}: bus {cell.can.interface}:{cell.can.channel} is locked by"
                f" another session ({_holder(path)}). Wait until it ends, or stop it: `rid-daq"
                f" stop {cell.name}`.",
                code="RID-CELL-BUSY",
            ) from None
        except OSError as error:
            raise RecordingError(
                f"{path}: cannot open the lock file: {error.strerror}{_advice(error)}",
                code="RID-FILE-ACCESS",
            ) from None
        stack.enter_context(registered_session(path, cell.name))
        yield


def as_label(text: str) -> str:
    """Convert a text, such as a file name, to a valid label of a run."""
    label = re.sub(r"[^\w .-]", "_", text)[:64] or "run"
    return f"{label}_" if label == LATEST else label


@contextlib.contextmanager
def mark_unfinished(folder: RunFolder) -> Iterator[None]:
    """Mark a run as stopped, with the reason, if an error or a signal ends the `with` block."""
    try:
        yield
    except BaseException as error:
        is_known = isinstance(error, RidDaqError)
        why = str(error) if is_known else "interrupted, or ended by an internal error"
        with contextlib.suppress(RidDaqError):
            folder.finish(RunStatus.STOPPED, {"why": why})
        raise


def lock_folder(cell: CellConfig) -> Path:
    """Return the folder of the lock of a cell's bus."""
    if cell.can.is_simulated:
        from mock_hw.host.runtime_directory import socket_path

        return socket_path(cell.can.channel).parent
    return machine_lock_folders()[0]


def lock_path(cell: CellConfig, folder: Path | None = None) -> Path:
    """Return the lock file of a cell's bus; `hold_cell` describes `folder`."""
    bus = f"{cell.can.interface}:{cell.can.channel}"
    words = re.sub(r"[^\w.-]", "_", bus)[-40:]
    return (
        folder or lock_folder(cell)
    ) / f"rid-daq-{words}-{hashlib.sha256(bus.encode()).hexdigest()[:8]}.lock"


def _holder(path: Path) -> str:
    """Describe the process that holds the lock of a bus."""
    pid = file_holder(path)
    if pid is None:
        return "its process has just ended, or runs in another container"
    session = session_on(path, pid)
    return f"process {pid}: {session.command}" if session and session.command else f"process {pid}"


def _advice(error: OSError) -> str:
    closed = isinstance(error, PermissionError)
    return "; its owner or root can remove it while no session runs" if closed else ""
