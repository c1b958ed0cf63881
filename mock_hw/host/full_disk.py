"""`FullDisk`: a small file system that is really filled, and emptied again."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from pathlib import Path

from config.errors import ConfigError, system_errors
from mock_hw.host.runtime_directory import runtime_directory

LARGEST_BYTES = 4 << 30
"""A larger file system is nobody's for the sake of a trial."""


def refuse_shared_disk(folder: Path) -> None:
    """Refuse a folder whose file system others need, or may need.

    Args:
        folder: Where recordings go; it may not be there yet.

    Raises:
        ConfigError: Its file system is larger than 4 GiB, or the one of the system, of temporary
            files, of shared memory or of the home folder.
    """
    there = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    needed = [Path("/"), Path(tempfile.gettempdir()), Path("/dev/shm"), runtime_directory()]
    with contextlib.suppress(RuntimeError):  # a user without a home
        needed.append(Path.home())
    devices = {path.stat().st_dev for path in needed if path.exists()}
    disk = os.statvfs(there)
    if there.stat().st_dev in devices or disk.f_blocks * disk.f_frsize > LARGEST_BYTES:
        raise ConfigError(
            f"program: disk_full: {folder} is on a file system that others need too, so it is not"
            f" filled: record onto one of its own of at most {LARGEST_BYTES >> 30} GiB, such as a"
            " small RAM disk (--runs), or use disk_error",
            code="RID-FAULT-SCRIPT",
        )


class FullDisk:
    """Takes all free room of a file system by a file without a name, until `release`.

    The room is free again whatever becomes of this process.

    Args:
        folder: A folder on it.
        leave_bytes: How much is left free.

    Raises:
        ConfigError: It is not one to be filled, see `refuse_shared_disk`; or it cannot be written.
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
        """Give the room back."""
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
                    take //= 2  # some of what is free cannot be had, or another was faster
                    if take < disk.f_frsize:
                        return
            size += take
