"""`DiskReserve`: room on a disk that is kept free for the end of a recording."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from pathlib import Path

from config.errors import RecordingError, system_errors

RESERVE_BYTES = 16 << 20
"""More than the ring and a journal's summary together."""

FULL = (errno.ENOSPC, errno.EDQUOT)


class DiskReserve:
    """Blocks of an unlinked temporary file: they are free again when this process ends.

    Args:
        folder: A folder on the disk.
        size_bytes: How much; 0 for none.

    Raises:
        RecordingError: There is not so much room.
    """

    def __init__(self, folder: Path, size_bytes: int) -> None:
        self._descriptor: int | None = None
        if not size_bytes:
            return
        with system_errors(RecordingError, f"{folder}: cannot be written", code="RID-FILE-WRITE"):
            descriptor, name = tempfile.mkstemp(".tmp", "reserve", folder)
            os.unlink(name)
        try:
            os.posix_fallocate(descriptor, 0, size_bytes)
        except OSError as error:
            os.close(descriptor)  # where no room can be kept, a full disk ends the file as it is
            if error.errno in FULL:
                raise RecordingError(
                    f"{folder}: no room for {size_bytes >> 20} MB that a recording keeps free for"
                    " its end: make room or choose another folder",
                    code="RID-SYSTEM-DISK-FULL",
                ) from error
            return
        self._descriptor = descriptor

    def release(self) -> bool:
        """Give the room back; return whether there was any."""
        if self._descriptor is None:
            return False
        with contextlib.suppress(OSError):
            os.close(self._descriptor)
        self._descriptor = None
        return True
