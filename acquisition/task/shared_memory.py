"""`SharedMemory`: anonymous memory of several processes, freed when the last process ends.

Another program of the same user can still find it through a process that has it. Therefore `rid-daq
stop` reaches a motion even if the program is too busy to answer.
"""

from __future__ import annotations

import mmap
import os
import weakref
from collections.abc import Callable, Iterator
from multiprocessing import reduction
from typing import Any


class SharedMemory:
    """Memory behind a file descriptor, initially zero; spawned processes receive it as an argument.

    Args:
        descriptor: Descriptor of a memory file; it is closed with this object.
        writable: True if this object may change the memory.
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
        """File descriptor, owned by this object."""
        return self._descriptor

    @classmethod
    def create(cls, label: str, size: int) -> SharedMemory:
        """Return new memory of `size` bytes; `label` identifies it to other programs.

        All pages are allocated at once, so that the first write to a page causes no delay.

        Raises:
            OSError: There is not enough memory.
        """
        import fcntl  # imported here, because only motions need this module

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
        """Yield the memories of another process that have this label, the last descriptor first.

        Memory whose owner could still shrink it is skipped: reading beyond its end would kill this
        process.

        Args:
            pid: Id of the process.
            label: Label passed to `create`.
            size: Memory of another size is skipped; None accepts any size.
            writable: True to map the memory for writing.

        Raises:
            PermissionError: The process belongs to another user.
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
            if status.st_ino in seen or not fits or not _has_fixed_size(descriptor):
                os.close(descriptor)
                continue
            seen.add(status.st_ino)
            yield cls(descriptor, writable)

    def __reduce__(self) -> tuple[Callable[..., SharedMemory], tuple[Any]]:
        return _unpickle_memory, (reduction.DupFd(self._descriptor),)


def _has_fixed_size(descriptor: int) -> bool:
    import fcntl

    try:
        return bool(fcntl.fcntl(descriptor, fcntl.F_GET_SEALS) & fcntl.F_SEAL_SHRINK)
    except OSError:  # not a memory file
        return False


def _unpickle_memory(duplicate: Any) -> SharedMemory:
    return SharedMemory(duplicate.detach())
