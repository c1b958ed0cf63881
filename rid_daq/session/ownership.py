"""Who owns a cell beyond one session: the service that serves it, for as long as it runs."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from config.cell.cell import CellConfig
from config.errors import LockedError, RecordingError
from config.process.file_locks import file_holder, held_file
from rid_daq.session.session import lock_path


@contextlib.contextmanager
def owned(cell: CellConfig) -> Iterator[None]:
    """Own a cell for as long as the `with` lasts: others must ask this process.

    Raises:
        LockedError: Another service owns it.
        RecordingError: The lock file cannot be opened.
    """
    path = _owner_file(cell)
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(held_file(path))
        except BlockingIOError:
            raise LockedError(
                f"cell {cell.name}: another service has it (process {file_holder(path)}): end that"
                " one, or leave the cell to it",
                code="RID-CELL-BUSY",
            ) from None
        except OSError as error:
            raise RecordingError(
                f"{path}: cannot open the lock file: {error.strerror}", code="RID-FILE-ACCESS"
            ) from None
        yield


def refuse_owned(cell: CellConfig) -> None:
    """Refuse a cell that a service owns, unless that service has started this very process.

    Raises:
        LockedError: A service owns it.
    """
    owner = file_holder(_owner_file(cell))
    if owner is not None and owner not in (os.getpid(), os.getppid()):
        raise LockedError(
            f"cell {cell.name}: the service has it (process {owner}): send this there with"
            " `--service local`, or end the service",
            code="RID-CELL-BUSY",
        )


def _owner_file(cell: CellConfig) -> Path:
    return lock_path(cell).with_suffix(".service")
