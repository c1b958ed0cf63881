"""Heartbeat, sent and watched (CiA 301, 7.2.8.3.2), and the consumer entry of 1016h.

Life guarding stands in its place where a node has no 1016h (CiA 301, 7.2.8.3.1): the master asks
for the node's state by remote frames; the node answers, and misses the questions.
"""

from __future__ import annotations

from drivers.canopen.frames import REMOTE_FLAG, Frame, heartbeat_cob_id
from drivers.canopen.nmt import NmtState


def heartbeat_frame(node_id: int, state: NmtState) -> Frame:
    """Return a heartbeat; with `NmtState.INITIALISING` it is the boot-up message."""
    return Frame(heartbeat_cob_id(node_id), bytes((state,)))


TOGGLE_BIT = 0x80
"""Alternates in answers to guarding, so that a controller that repeats the last one is found."""


def guard_request(node_id: int) -> Frame:
    """Return the remote frame that asks a node for its state."""
    return Frame(REMOTE_FLAG | heartbeat_cob_id(node_id), bytes(1))


def guard_answer(node_id: int, state: NmtState, toggle: bool) -> Frame:
    """Return a node's answer."""
    return Frame(heartbeat_cob_id(node_id), bytes((state | TOGGLE_BIT * toggle,)))


def consumer_entry(node_id: int, timeout_ms: int) -> int:
    """Return the U32 of 1016h that makes a node watch `node_id` (CiA 301, 7.5.2.17)."""
    return node_id << 16 | timeout_ms


def parse_consumer_entry(entry: int) -> tuple[int, float] | None:
    """Return (node id, timeout [s]) of an entry of 1016h; None when the entry is unused."""
    node_id, timeout_ms = entry >> 16 & 0x7F, entry & 0xFFFF
    return (node_id, timeout_ms / 1000.0) if node_id and timeout_ms else None


class HeartbeatProducer:
    """Says when the next heartbeat is due; beats that were missed are not made up for."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._next_s = float("-inf")

    def due(self, now_s: float) -> bool:
        """Return whether a heartbeat is to be sent now [s], and count it as sent."""
        if now_s < self._next_s:
            return False
        on_time_s = self._next_s + self._period_s
        self._next_s = on_time_s if on_time_s > now_s else now_s + self._period_s
        return True


class HeartbeatConsumer:
    """Watches one node's heartbeat.

    Watching begins with the first heartbeat (CiA 301, 7.2.8.3.2) or with `start`.

    Attributes:
        state: The state of the last heartbeat's byte, None before the first.
        lost: Whether the heartbeat has timed out and has not come back since.
        guarded: Whether it is asked for: then one with the toggle bit of the last is none.
    """

    def __init__(self, timeout_s: float, *, guarded: bool = False) -> None:
        self._timeout_s = timeout_s
        self.guarded = guarded
        self._toggle = -1
        self._last_s: float | None = None
        self.state: int | None = None
        self.lost = False

    def start(self, now_s: float) -> None:
        """Begin to watch now [s], whether or not a heartbeat has been heard."""
        self._last_s = now_s
        self.lost = False
        self._toggle = -1

    def heard(self, state: int, now_s: float, toggle: int = 0) -> None:
        """Take a heartbeat that arrived at `now_s` [s], or a guarded node's answer."""
        if self.guarded and toggle == self._toggle:
            return
        self._toggle = toggle
        self.state = state
        self._last_s = now_s
        self.lost = False

    def expired(self, now_s: float) -> bool:
        """Return True once, when the node has been silent for longer than the timeout."""
        if self.lost or self._last_s is None or now_s - self._last_s <= self._timeout_s:
            return False
        self.lost = True
        return True
