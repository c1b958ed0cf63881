"""`SharedBlock`: words that processes share; `SharedError`: an error on its way to another one."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from typing import Any, ClassVar, Self

from acquisition.task.shared_memory import SharedMemory
from config import errors
from config.errors import DriverError, RidDaqError


class SharedError(ctypes.Structure):
    """The error that ended a process, on its way to another one; a part of a block's words."""

    _fields_ = (
        ("_there", ctypes.c_int64),
        ("_kind", ctypes.c_char * 64),
        ("_refusal", ctypes.c_char * 64),
        ("_text", ctypes.c_char * 4096),
    )

    def put(self, error: RidDaqError) -> None:
        """Write an error, or a later one over it."""
        self._kind = clipped(type(error).__name__, 63)
        self._refusal = clipped(error.refusal, 63)
        self._text = clipped(str(error), 4095)
        self._there = 1

    def get(self) -> RidDaqError | None:
        """Return it as what it was; None where there is none."""
        if not self._there:
            return None
        kind = getattr(errors, self._kind.decode(errors="replace"), DriverError)
        if not (isinstance(kind, type) and issubclass(kind, RidDaqError)):
            kind = DriverError
        refusal = self._refusal.decode(errors="replace")
        return kind(self._text.decode(errors="replace"), code=refusal)


class SharedBlock:
    """Words in memory that processes share; made by `create`, handed to them as an argument.

    Args:
        memory: As large as the words.

    Attributes:
        LABEL: Says what is in the memory, and in which layout: counted up where that changes.
        WORDS: The layout.
    """

    LABEL: ClassVar[str]
    WORDS: ClassVar[type[ctypes.Structure]]

    def __init__(self, memory: SharedMemory) -> None:
        self._memory = memory
        self._words: Any = self.WORDS.from_buffer(memory.buffer)

    @classmethod
    def create(cls) -> Self:
        """Return a cleared block in fresh shared memory."""
        return cls(SharedMemory.create(cls.LABEL, ctypes.sizeof(cls.WORDS)))

    @classmethod
    def all_of_process(cls, pid: int) -> Iterator[Self]:
        """Yield the blocks of this kind that another process has, the newest first.

        Raises:
            PermissionError: The process is not this user's.
        """
        for memory in SharedMemory.of_process(pid, cls.LABEL, ctypes.sizeof(cls.WORDS)):
            yield cls(memory)

    def __reduce__(self) -> tuple[Callable[..., SharedBlock], tuple[Any]]:
        return type(self), (self._memory,)


def clipped(text: str, size: int) -> bytes:
    """Return a text as at most `size` bytes, for a word that ends with a zero."""
    return text.encode().replace(b"\0", b"?")[:size].decode(errors="ignore").encode()
