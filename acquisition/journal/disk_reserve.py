"""`DiskReserve`: disk space that is kept free for the end of a recording."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from pathlib import Path

from config.errors import RecordingError, system_errors

FREE_BYTES = 500 << 20
"Free disk space that must remain beside the expected recording before a motion [bytes]."

RESERVE_BYTES = 16 << 20
"Size of the reserve, for the rows in the ring and the summary of the journal [bytes]."

FULL = (errno.ENOSPC, errno.EDQUOT)


class DiskReserve:
    """Disk space of an unlinked temporary file; it is free again when this process ends.

    Args:
        folder: A folder on the disk.
        size_bytes: Size of the reserve; 0 for none.

    Raises:
        RecordingError: The folder cannot be written, or the disk has less free space than
            `size_bytes`. If the file system cannot reserve space, there is no error and no reserve.
    """

    def __init__(self, folder: Path, size_bytes: int) -> None:
        self._descriptor: int | None = None
        if not size_bytes:
            return
        with system_errors(RecordingError, f"{folder}: cannot be written", code="RID-FILE-WRITE"):
            descriptor, name = tempfile.mkstemp(".tmp", "reserve", folder)
            os.unlink(name)
        try:
            _allocate(descriptor, size_bytes)
        except OSError as error:
            os.close(descriptor)  # without a reserve, a full disk leaves the file unfinished
            if error.errno in FULL:
                raise RecordingError(
                    f"{folder}: no space for the {size_bytes >> 20} MB that a recording reserves"
                    " for its end: free disk space or choose another folder",
                    code="RID-SYSTEM-DISK-FULL",
                ) from error
            return
        self._descriptor = descriptor

    def release(self) -> bool:
        """Free the space; return False if nothing was reserved."""
        if self._descriptor is None:
            return False
        with contextlib.suppress(OSError):
            os.close(self._descriptor)
        self._descriptor = None
        return True


def _allocate(descriptor: int, size_bytes: int) -> None:
    """Allocate the space of a file; macOS has no posix_fallocate, so zeros are written there."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(descriptor, 0, size_bytes)
        return
    zeros = bytes(1 << 20)
    while size_bytes > 0:
        size_bytes -= os.write(descriptor, zeros[:size_bytes])
