"""Ownership of a cell by a service: it lasts until the service ends."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from config.cell.cell import CellConfig
from config.errors import LockedError, RecordingError
from config.process.file_locks import file_holder, held_file
from rid_daq.session.session import lock_path

_accepted_owners: Final[set[int]] = set()


def accept_owner(pid: int) -> None:
    """Let this process open the cells of the service that has started it for a job.

    Args:
        pid: Process id of the service.
    """
    _accepted_owners.add(pid)


@contextlib.contextmanager
def own_cell(cell: CellConfig) -> Iterator[None]:
    """Own a cell inside the `with` block: other processes must send their requests to this process.

    Raises:
        LockedError: Another service owns the cell.
        RecordingError: The lock file cannot be opened.
    """
    path = _owner_file(cell)
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(held_file(path))
        except BlockingIOError:
            raise LockedError(
                f"cell {cell.name}: another service owns it (process {file_holder(path)}): end"
                " that service, or do not serve this cell here",
                code="RID-CELL-BUSY",
            ) from None
        except OSError as error:
            raise RecordingError(
                f"{path}: cannot open the lock file: {error.strerror}", code="RID-FILE-ACCESS"
            ) from None
        yield


def refuse_owned(cell: CellConfig) -> None:
    """Raise an error if a service owns the cell, except if it has started this process for a job.

    Raises:
        LockedError: A service owns the cell.
        RecordingError: The lock file cannot be read.
    """
    owner = file_holder(_owner_file(cell))
    if owner is not None and owner not in (os.getpid(), *_accepted_owners):
        raise LockedError(
            f"cell {cell.name}: a service owns it (process {owner}): send the request to it with"
            " `--service local`, or end the service",
            code="RID-CELL-BUSY",
        )


def _owner_file(cell: CellConfig) -> Path:
    return lock_path(cell).with_suffix(".service")
