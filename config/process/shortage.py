"""`as_shortage`: what Python, C libraries and the kernel say where a computer lacks something.

Python says it in many ways: as an error of memory, of a file, of a library that cannot be loaded,
of a thread that cannot start, often inside of another error that it led to.
"""

from __future__ import annotations

import contextlib
import errno
import mmap
import resource
from collections.abc import Iterator
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
    errno.EFBIG: "a file would be larger than files may be: raise the limit (`ulimit -f`)",
    errno.ENOSPC: "the disk is full: make room",
    errno.EDQUOT: "your share of the disk is used up: make room",
    errno.EROFS: "the disk may only be read: choose a folder on another one",
    errno.EIO: "the disk or a device failed: look at its health (`dmesg`)",
}

_BY_WORDS: Final[dict[str, str]] = {
    "failed to map segment": _MEMORY,
    "cannot allocate memory": _MEMORY,
    "can't allocate lock": _MEMORY,
    "start new thread": _PROCESSES,
    "too many open files": _FILES,
}
"""What libraries say in words alone."""

_NEAR_BYTES: Final = 4 << 20


def as_shortage(error: BaseException) -> ShortageError | None:
    """Return what is lacking, where an error or one that led to it says so; else None."""
    for each in _with_causes(error):
        if isinstance(each, ShortageError):
            return each
        if isinstance(each, MemoryError):
            return ShortageError(_MEMORY, code="RID-SYSTEM-SHORTAGE")
        if isinstance(each, OSError) and each.errno in _BY_NUMBER:
            where = "" if each.filename is None else f"{each.filename}: "
            return ShortageError(f"{where}{_BY_NUMBER[each.errno]}", code="RID-SYSTEM-SHORTAGE")
        words = str(each).lower()
        for said, lacking in _BY_WORDS.items():
            if said in words and isinstance(each, (ImportError, OSError, RuntimeError)):
                return ShortageError(lacking, code="RID-SYSTEM-SHORTAGE")
    if isinstance(error, Exception) and not isinstance(error, RidDaqError) and _memory_was_full():
        return ShortageError(
            f"{_MEMORY}; it failed with {type(error).__name__}: {error}", code="RID-SYSTEM-SHORTAGE"
        )
    return None


def as_named(error: Exception) -> RidDaqError:
    """Return an error that has a name of ours: itself, or what is lacking.

    Raises:
        Exception: The error, which is then a mistake of the program.
    """
    if isinstance(error, RidDaqError):
        return error
    lacking = as_shortage(error)
    if lacking is None:
        raise error
    return type(lacking)(with_notes(str(lacking), error), code=lacking.refusal)


def require_memory(needed_bytes: int) -> None:
    """Refuse to begin what could not be finished: numerical libraries do not fail well.

    Without memory one ends the program, another waits for ever.

    Raises:
        ShortageError: So much address space cannot be had.
    """
    try:
        flags = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS
        mmap.mmap(-1, needed_bytes, flags=flags, prot=mmap.PROT_READ).close()
    except (OSError, MemoryError):
        raise ShortageError(
            f"{_MEMORY}: {needed_bytes >> 20} MB more are needed", code="RID-SYSTEM-SHORTAGE"
        ) from None


def _with_causes(error: BaseException) -> Iterator[BaseException]:
    """Yield an error and those that led to it."""
    seen: set[int] = set()
    waiting: list[BaseException | None] = [error]
    while waiting:
        each = waiting.pop()
        if each is not None and id(each) not in seen:
            seen.add(id(each))
            yield each
            waiting += [each.__context__, each.__cause__]


def _memory_was_full() -> bool:
    """Return whether this process was at its limit: any error may come of that."""
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return False
    with contextlib.suppress(OSError, ValueError), open("/proc/self/status", "rb") as file:
        for line in file:
            if line.startswith(b"VmPeak:"):
                return int(line.split()[1]) * 1024 > limit - _NEAR_BYTES
    return False
