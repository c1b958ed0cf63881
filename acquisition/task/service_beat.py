"""`ServiceBeat`: heartbeat of the service that ordered a motion, and the end of its lease."""

from __future__ import annotations

import ctypes
from typing import Final, Self

from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.shared_block import SharedBlock
from acquisition.task.shared_memory import SharedMemory

SERVICE_LIMIT_S: Final = 3.0
"""Largest age of the service's heartbeat before its motion stops [s]."""

CLIENT_LOST_TEXT: Final = "stopped because the motion's client has lost the lease of the cell"


class _Words(ctypes.Structure):
    _fields_ = (("beat_s", ctypes.c_double), ("lease_end_s", ctypes.c_double))


class ServiceBeat(SharedBlock):
    """Shared memory that the service's event loop writes; a blocked event loop counts as hung.

    Times are those of the safety clock. A process that moves a robot for the service checks this
    block in every cycle.
    """

    LABEL = "rid-daq-service-1"
    WORDS = _Words

    @classmethod
    def from_descriptor(cls, descriptor: int) -> Self:
        """Return the block behind an inherited file descriptor."""
        return cls(SharedMemory(descriptor))

    @property
    def descriptor(self) -> int:
        """File descriptor of the memory, which a new process inherits."""
        return self._memory.descriptor

    def write(self, now_s: float, lease_end_s: float) -> None:
        """Write a heartbeat.

        Args:
            now_s: Present time [s].
            lease_end_s: End of the motion's lease; infinity if the motion may continue without its
                client [s].
        """
        self._words.lease_end_s = lease_end_s
        self._words.beat_s = now_s

    def reason(self, now_s: float) -> StopReason | None:
        """Return the reason for which the ordered motion must stop; None if it may continue."""
        silent_s = now_s - self._words.beat_s
        if silent_s > SERVICE_LIMIT_S:
            return StopReason(
                StopCode.SERVICE_LOST,
                f"the service has sent no heartbeat for {silent_s:.1f} s (limit"
                f" {SERVICE_LIMIT_S:g} s): it hangs or was suspended. Check its log and the load"
                " of the computer",
                value=silent_s,
                limit=SERVICE_LIMIT_S,
            )
        if now_s >= self._words.lease_end_s:
            return StopReason(StopCode.CLIENT_LOST, CLIENT_LOST_TEXT)
        return None
