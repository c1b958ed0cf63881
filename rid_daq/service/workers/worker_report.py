"""`WorkerReport`: message of the template about a worker."""

from __future__ import annotations

from enum import IntEnum
from struct import Struct
from typing import Final, NamedTuple, Self

REQUEST: Final = b"w"
"""Message that requests a worker; the service sends the file descriptors of the worker's orders,
its log and the heartbeat with it.
"""

REPORT: Final = Struct("=iii")


class ReportKind(IntEnum):
    """Event of a worker's life."""

    STARTED = 0
    NOT_STARTED = 1
    ENDED = 2


class WorkerReport(NamedTuple):
    """Message of the template about a worker.

    Attributes:
        kind: The event; a message with STARTED also carries a pidfd of the worker.
        pid: Process id of the worker; 0 if it was not started.
        value: For STARTED 0; for NOT_STARTED the error number; for ENDED the exit code, or the
            negative number of the signal that killed the worker.
    """

    kind: ReportKind
    pid: int = 0
    value: int = 0

    def pack(self) -> bytes:
        """Return the message."""
        return REPORT.pack(*self)

    @classmethod
    def unpack(cls, message: bytes) -> Self:
        """Return the report in a message."""
        kind, pid, value = REPORT.unpack(message)
        return cls(ReportKind(kind), pid, value)
