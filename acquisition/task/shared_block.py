"""`SharedBlock`: structure in memory that processes share; `SharedError`: an error in it."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from typing import Any, ClassVar, Self

from acquisition.task.shared_memory import SharedMemory
from config import errors
from config.errors import DriverError, RidDaqError


class SharedError(ctypes.Structure):
    """Error that ended a process, as a part of a shared block, for another process."""

    _fields_ = (
        ("_is_set", ctypes.c_int64),
        ("_kind", ctypes.c_char * 64),
        ("_refusal", ctypes.c_char * 64),
        ("_text", ctypes.c_char * 4096),
    )

    def put(self, error: RidDaqError) -> None:
        """Write an error; it replaces an earlier one."""
        self._kind = clip_text(type(error).__name__, 63)
        self._refusal = clip_text(error.refusal, 63)
        self._text = clip_text(str(error), 4095)
        self._is_set = 1

    def get(self) -> RidDaqError | None:
        """Return the error with its class and code; None without an error."""
        if not self._is_set:
            return None
        kind = getattr(errors, self._kind.decode(errors="replace"), DriverError)
        if not (isinstance(kind, type) and issubclass(kind, RidDaqError)):
            kind = DriverError
        refusal = self._refusal.decode(errors="replace")
        return kind(self._text.decode(errors="replace"), code=refusal)


class SharedBlock:
    """Structure in shared memory; `create` makes it, processes receive it as an argument.

    Args:
        memory: Memory with the size of the structure.

    Attributes:
        LABEL: Name and version of the layout; the version increases if the layout changes.
        WORDS: The layout.
    """

    LABEL: ClassVar[str]
    WORDS: ClassVar[type[ctypes.Structure]]

    def __init__(self, memory: SharedMemory) -> None:
        self._memory = memory
        self._words: Any = self.WORDS.from_buffer(memory.buffer)

    @classmethod
    def create(cls) -> Self:
        """Return a block of zeros in new shared memory."""
        return cls(SharedMemory.create(cls.LABEL, ctypes.sizeof(cls.WORDS)))

    @classmethod
    def all_of_process(cls, pid: int) -> Iterator[Self]:
        """Yield the blocks of this kind that another process has, the newest first.

        Raises:
            PermissionError: The process belongs to another user.
        """
        for memory in SharedMemory.of_process(pid, cls.LABEL, ctypes.sizeof(cls.WORDS)):
            yield cls(memory)

    def __reduce__(self) -> tuple[Callable[..., SharedBlock], tuple[Any]]:
        return type(self), (self._memory,)


def clip_text(text: str, size: int) -> bytes:
    """Return a text as at most `size` bytes, without zero bytes, for a zero-terminated field."""
    return text.encode().replace(b"\0", b"?")[:size].decode(errors="ignore").encode()
