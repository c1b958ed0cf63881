"""`as_shortage`: recognise errors that mean that the computer is short of a resource.

Python reports a shortage in many ways: as an error of memory, of a file, of a library that cannot
be loaded, of a thread that cannot start, often as the cause of another error.
"""

from __future__ import annotations

import contextlib
import errno
import mmap
from typing import Final

from config.errors import RidDaqError, ShortageError, with_notes

_MEMORY: Final = "not enough memory: end other programs, or raise the limit (`ulimit -v`)"
_PROCESSES: Final = "no more processes or threads can be started: end some (limit: `ulimit -u`)"
_FILES: Final = "too many files are open: raise the limit (`ulimit -n`)"

_BY_NUMBER: Final[dict[int, str]] = {
    errno.ENOMEM: _MEMORY,
    errno.EAGAIN: _PROCESSES,
    errno.EMFILE: _FILES,
    errno.ENFILE: "this computer has too many files open: end other programs",
    errno.EFBIG: "a file would exceed the size limit of files: raise the limit (`ulimit -f`)",
    errno.ENOSPC: "the disk is full: delete files",
    errno.EDQUOT: "your disk quota is used up: delete files",
    errno.EROFS: "the disk is read-only: choose a folder on another disk",
    errno.EIO: "the disk or a device failed: check its health (`dmesg`)",
}

_BY_WORDS: Final[dict[str, str]] = {
    "failed to map segment": _MEMORY,
    "cannot allocate memory": _MEMORY,
    "can't allocate lock": _MEMORY,
    "start new thread": _PROCESSES,
    "too many open files": _FILES,
}
"""Texts of libraries that report a shortage without an error number."""

_NEAR_BYTES: Final = 4 << 20


def as_shortage(error: BaseException) -> ShortageError | None:
    """Return the shortage that an error or one of its causes reports; None otherwise.

    If this process has reached its memory limit, any other unexpected error counts as a shortage.
    """
    for each in _with_causes(error):
        if isinstance(each, ShortageError):
            return each
        if isinstance(each, MemoryError):
            return ShortageError(_MEMORY, code="RID-SYSTEM-SHORTAGE")
        if isinstance(each, OSError) and each.errno in _BY_NUMBER:
            where = "" if each.filename is None else f"{each.filename}: "
            return ShortageError(f"{where}{_BY_NUMBER[each.errno]}", code="RID-SYSTEM-SHORTAGE")
        words = str(each).lower()
        for phrase, lacking in _BY_WORDS.items():
            if phrase in words and isinstance(each, (ImportError, OSError, RuntimeError)):
                return ShortageError(lacking, code="RID-SYSTEM-SHORTAGE")
    if isinstance(error, Exception) and not isinstance(error, RidDaqError) and _memory_was_full():
        return ShortageError(
            f"{_MEMORY}; it failed with {type(error).__name__}: {error}", code="RID-SYSTEM-SHORTAGE"
        )
    return None


def named_error(error: Exception) -> RidDaqError:
    """Return the error itself if it is a `RidDaqError`, or the shortage that it reports.

    Raises:
        Exception: The error itself, if it is neither; it is then a defect of the program.
    """
    if isinstance(error, RidDaqError):
        return error
    lacking = as_shortage(error)
    if lacking is None:
        raise error
    return type(lacking)(with_notes(str(lacking), error), code=lacking.refusal)


def require_memory(needed_bytes: int) -> None:
    """Refuse a computation for which there is not enough address space (`ulimit -v`).

    Without memory, some numerical libraries end the program and others hang.

    Raises:
        ShortageError: This much address space is not available.
    """
    try:
        flags = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS
        mmap.mmap(-1, needed_bytes, flags=flags, prot=mmap.PROT_READ).close()
    except (OSError, MemoryError):
        raise ShortageError(
            f"{_MEMORY}: {needed_bytes >> 20} MB more are needed", code="RID-SYSTEM-SHORTAGE"
        ) from None


def _with_causes(error: BaseException) -> list[BaseException]:
    """Return an error and its causes.

    It is no generator: without memory, an unfinished generator cannot be closed.
    """
    found: list[BaseException] = []
    waiting: list[BaseException | None] = [error]
    while waiting:
        each = waiting.pop()
        if each is not None and all(each is not other for other in found):
            found.append(each)
            waiting += [each.__context__, each.__cause__]
    return found


def _memory_was_full() -> bool:
    """Return whether this process was at its memory limit, which can cause any error."""
    try:
        import resource
    except ImportError:  # not on Windows
        return False
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return False
    with contextlib.suppress(OSError, ValueError), open("/proc/self/status", "rb") as file:
        for line in file:
            if line.startswith(b"VmPeak:"):
                return int(line.split()[1]) * 1024 > limit - _NEAR_BYTES
    return False
