"""A session: the runs' folder, and the lock that keeps a second session off the same bus."""

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
from rid_daq.session.running_sessions import machine_lock_folders, session_on, signed


@contextlib.contextmanager
def hold_cell(cell: CellConfig, folder: Path | None = None) -> Iterator[None]:
    """Hold a cell's bus alone for as long as the `with` lasts.

    The lock belongs to the operating system: it ends with this process, however that ends. A file
    beside it says to `rid-daq stop` what holds it.

    Args:
        cell: The cell whose bus (interface and channel) nobody else may command meanwhile.
        folder: Where lock files live. Unless told, the machine's lock folder, and for a simulated
            bus the folder that its socket is in.

    Raises:
        LockedError: Another session holds the bus; the message says which.
        RecordingError: The lock file cannot be opened, or the session's not be written.
    """
    path = lock_path(cell, folder)
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(held_file(path))
        except BlockingIOError:
            raise LockedError(
                f"cell {cell.name}: bus {cell.can.interface}:{cell.can.channel} is held by another"
                f" session ({_holder(path)}). Wait until it ends, or stop it:"
                f" `rid-daq stop {cell.name}`.",
                code="RID-CELL-BUSY",
            ) from None
        except OSError as error:
            raise RecordingError(
                f"{path}: cannot open the lock file: {error.strerror}{_advice(error)}",
                code="RID-FILE-ACCESS",
            ) from None
        stack.enter_context(signed(path, cell.name))
        yield


def as_label(text: str) -> str:
    """Return text, such as a file's name, as a run's label may be."""
    label = re.sub(r"[^\w .-]", "_", text)[:64] or "run"
    return f"{label}_" if label == LATEST else label


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
        from mock_hw.host.runtime_directory import socket_path

        return socket_path(cell.can.channel).parent
    return machine_lock_folders()[0]


def lock_path(cell: CellConfig, folder: Path | None = None) -> Path:
    """Return the lock of a cell's bus; `folder` as `hold_cell` has it."""
    bus = f"{cell.can.interface}:{cell.can.channel}"
    words = re.sub(r"[^\w.-]", "_", bus)[-40:]
    return (
        folder or lock_folder(cell)
    ) / f"rid-daq-{words}-{hashlib.sha256(bus.encode()).hexdigest()[:8]}.lock"


def _holder(path: Path) -> str:
    """Say who holds the lock of a bus."""
    pid = file_holder(path)
    if pid is None:
        return "which has just ended, or runs in another container"
    session = session_on(path, pid)
    return f"process {pid}: {session.command}" if session and session.command else f"process {pid}"


def _advice(error: OSError) -> str:
    closed = isinstance(error, PermissionError)
    return "; its owner or root can remove it while no session runs" if closed else ""
