"""`SharedMemory`: memory of several processes that has no name and is gone with the last of them.

Another program of the same user can find it all the same, through a process that has it: that is
how `rid-daq stop` reaches a motion without asking the program that may be too busy to answer.
"""

from __future__ import annotations

import fcntl
import mmap
import os
import weakref
from collections.abc import Callable, Iterator
from multiprocessing import reduction
from typing import Any


class SharedMemory:
    """Zeroed memory behind a file descriptor; handed to spawned processes as an argument.

    Args:
        descriptor: Of a memory file; it is closed with this object.
        writable: Whether its bytes may be changed through this object.
    """

    def __init__(self, descriptor: int, writable: bool = True) -> None:
        self._descriptor = descriptor
        weakref.finalize(self, os.close, descriptor)
        self.buffer = mmap.mmap(
            descriptor,
            os.fstat(descriptor).st_size,
            flags=mmap.MAP_SHARED | mmap.MAP_POPULATE,
            prot=mmap.PROT_READ | (mmap.PROT_WRITE if writable else 0),
        )

    @property
    def descriptor(self) -> int:
        """The file descriptor; it is this object's."""
        return self._descriptor

    @classmethod
    def create(cls, label: str, size: int) -> SharedMemory:
        """Return fresh memory of `size` bytes; `label` says to other programs what it is.

        All of it is there at once, so that no page is waited for when it is first written to.

        Raises:
            OSError: There is not so much memory.
        """
        descriptor = os.memfd_create(label, os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        try:
            os.posix_fallocate(descriptor, 0, size)
        except OSError:
            os.close(descriptor)
            raise
        fcntl.fcntl(descriptor, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW)
        return cls(descriptor)

    @classmethod
    def of_process(
        cls, pid: int, label: str, size: int | None = None, writable: bool = True
    ) -> Iterator[SharedMemory]:
        """Yield what another process has of this label, the last descriptor first.

        Memory that its owner could still shrink is left out: who reads beyond its end is killed.

        Args:
            pid: The process.
            label: As at `create`.
            size: What has another size is left out; None for any.
            writable: Whether its bytes are to be changed.

        Raises:
            PermissionError: The process is not this user's.
        """
        folder = f"/proc/{pid}/fd"
        try:
            numbers = sorted((int(name) for name in os.listdir(folder)), reverse=True)
        except (FileNotFoundError, ProcessLookupError):
            return
        seen = set()
        for number in numbers:
            try:
                if os.readlink(f"{folder}/{number}") != f"/memfd:{label} (deleted)":
                    continue
                mode = os.O_RDWR if writable else os.O_RDONLY
                descriptor = os.open(f"{folder}/{number}", mode | os.O_CLOEXEC)
            except (FileNotFoundError, ProcessLookupError):
                continue
            status = os.fstat(descriptor)
            fits = size in (None, status.st_size) and status.st_size > 0
            if status.st_ino in seen or not fits or not _keeps_size(descriptor):
                os.close(descriptor)
                continue
            seen.add(status.st_ino)
            yield cls(descriptor, writable)

    def __reduce__(self) -> tuple[Callable[..., SharedMemory], tuple[Any]]:
        return _received, (reduction.DupFd(self._descriptor),)


def _keeps_size(descriptor: int) -> bool:
    try:
        return bool(fcntl.fcntl(descriptor, fcntl.F_GET_SEALS) & fcntl.F_SEAL_SHRINK)
    except OSError:  # not a memory file
        return False


def _received(duplicate: Any) -> SharedMemory:
    return SharedMemory(duplicate.detach())
