"""`ServiceBeat`: signs of life of the service that has ordered a motion, and the motion's lease."""

from __future__ import annotations

import ctypes
from typing import Final, Self

from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.shared_block import SharedBlock
from acquisition.task.shared_memory import SharedMemory

SERVICE_LIMIT_S: Final = 3.0
"""How long the service may give no sign of life before what it has ordered stops [s]."""

CLIENT_LOST_TEXT: Final = "stopped because its client is out of reach"


class _Words(ctypes.Structure):
    _fields_ = (("beat_s", ctypes.c_double), ("lease_end_s", ctypes.c_double))


class ServiceBeat(SharedBlock):
    """Written by the service's event loop, so that one that is blocked counts as hung.

    Times are of the safety clock. Whoever moves a robot for the service looks at it in every cycle.
    """

    LABEL = "rid-daq-service-1"
    WORDS = _Words

    @classmethod
    def inherited(cls, descriptor: int) -> Self:
        """Return the block behind a descriptor that this process was started with."""
        return cls(SharedMemory(descriptor))

    @property
    def descriptor(self) -> int:
        """The descriptor of its memory, for a process that is started."""
        return self._memory.descriptor

    def give(self, now_s: float, lease_end_s: float) -> None:
        """Give a sign of life.

        Args:
            now_s: The time [s].
            lease_end_s: When the lease of the motion ends; infinity for what may go on without its
                client [s].
        """
        self._words.lease_end_s = lease_end_s
        self._words.beat_s = now_s

    def reason(self, now_s: float) -> StopReason | None:
        """Return why what the service has ordered must stop now; None if it may go on."""
        silent_s = now_s - self._words.beat_s
        if silent_s > SERVICE_LIMIT_S:
            return StopReason(
                StopCode.SERVICE_LOST,
                f"the service has given no sign of life for {silent_s:.1f} s;"
                f" {SERVICE_LIMIT_S:g} s are allowed. It hangs or was suspended: see its log and"
                " the computer's load",
                value=silent_s,
                limit=SERVICE_LIMIT_S,
            )
        if now_s >= self._words.lease_end_s:
            return StopReason(StopCode.CLIENT_LOST, CLIENT_LOST_TEXT)
        return None
