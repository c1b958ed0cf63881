"""`FullDisk`: fills a small file system for a test, and frees the space again."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from pathlib import Path

from config.errors import ConfigError, system_errors
from mock_hw.host.runtime_directory import runtime_directory

LARGEST_BYTES = 4 << 30
"""Size of the largest file system that is filled [bytes]; a larger one is probably not meant for
such a test."""


def refuse_shared_disk(folder: Path) -> None:
    """Raise an error if other programs may need the file system of a folder.

    Args:
        folder: Folder of the recordings; it may not exist yet.

    Raises:
        ConfigError: The file system is larger than 4 GiB, or it contains the system, temporary
            files, shared memory, the home folder or the runtime folder.
    """
    there = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    needed = [Path("/"), Path(tempfile.gettempdir()), Path("/dev/shm"), runtime_directory()]
    with contextlib.suppress(RuntimeError):  # a user without a home
        needed.append(Path.home())
    devices = {path.stat().st_dev for path in needed if path.exists()}
    disk = os.statvfs(there)
    if there.stat().st_dev in devices or disk.f_blocks * disk.f_frsize > LARGEST_BYTES:
        raise ConfigError(
            f"program: disk_full: other programs may need the file system of {folder}, so it is"
            f" not filled: record to a separate file system of at most {LARGEST_BYTES >> 30} GiB,"
            " such as a small RAM disk (--runs), or use disk_error",
            code="RID-FAULT-SCRIPT",
        )


class FullDisk:
    """Fills all free space of a file system with an unlinked file, until `release`.

    The operating system frees the space when this process ends, even if it is killed.

    Args:
        folder: A folder on the file system.
        leave_bytes: Number of bytes that stay free.

    Raises:
        ConfigError: The file system must not be filled (`refuse_shared_disk`), or cannot be
            written.
    """

    def __init__(self, folder: Path, leave_bytes: int = 0) -> None:
        refuse_shared_disk(folder)
        with system_errors(ConfigError, f"{folder}: cannot be filled", code="RID-FAULT-SCRIPT"):
            self._descriptor, name = tempfile.mkstemp(".tmp", "filled", folder)
            os.unlink(name)
        try:
            self._fill(leave_bytes)
        except OSError as error:
            self.release()
            raise ConfigError(
                f"{folder}: cannot be filled: {error.strerror}", code="RID-FAULT-SCRIPT"
            ) from error

    def release(self) -> None:
        """Free the space."""
        os.close(self._descriptor)

    def _fill(self, leave_bytes: int) -> None:
        size = 0
        while True:
            disk = os.fstatvfs(self._descriptor)
            free = (disk.f_bfree if os.geteuid() == 0 else disk.f_bavail) * disk.f_frsize
            take = free - leave_bytes
            if take < disk.f_frsize:
                return
            while True:
                try:
                    os.posix_fallocate(self._descriptor, size, take)
                    break
                except OSError as error:
                    if error.errno != errno.ENOSPC:
                        raise
                    take //= 2  # less space is available than reported
                    if take < disk.f_frsize:
                        return
            size += take
