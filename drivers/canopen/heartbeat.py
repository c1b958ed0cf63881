"""Production and monitoring of heartbeats (CiA 301, 7.2.8.3.2), and the consumer entry of 1016h.

A node without 1016h uses life guarding instead of heartbeats (CiA 301, 7.2.8.3.1): the master
requests the node's state by remote frames, and the node answers and detects missing requests.
"""

from __future__ import annotations

from drivers.canopen.frames import REMOTE_FLAG, Frame, heartbeat_cob_id
from drivers.canopen.nmt import NmtState


def heartbeat_frame(node_id: int, state: NmtState) -> Frame:
    """Return a heartbeat; with `NmtState.INITIALISING` it is the boot-up message."""
    return Frame(heartbeat_cob_id(node_id), bytes((state,)))


TOGGLE_BIT = 0x80
"""Toggle bit in the answers to life guarding. It alternates, so that the master detects a CAN
controller that only repeats its last answer.
"""


def guard_request(node_id: int) -> Frame:
    """Return the remote frame of life guarding that requests a node's state."""
    return Frame(REMOTE_FLAG | heartbeat_cob_id(node_id), bytes(1))


def guard_answer(node_id: int, state: NmtState, toggle: bool) -> Frame:
    """Return a node's answer to a request of life guarding."""
    return Frame(heartbeat_cob_id(node_id), bytes((state | TOGGLE_BIT * toggle,)))


def consumer_entry(node_id: int, timeout_ms: int) -> int:
    """Return the U32 of 1016h that makes a node monitor `node_id` (CiA 301, 7.5.2.17)."""
    return node_id << 16 | timeout_ms


def parse_consumer_entry(entry: int) -> tuple[int, float] | None:
    """Return (node id, timeout [s]) of an entry of 1016h; None if the entry is unused."""
    node_id, timeout_ms = entry >> 16 & 0x7F, entry & 0xFFFF
    return (node_id, timeout_ms / 1000.0) if node_id and timeout_ms else None


class HeartbeatProducer:
    """Schedule of this node's own heartbeats; heartbeats that were missed are not sent later."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._next_s = float("-inf")

    def due(self, now_s: float) -> bool:
        """Return True if a heartbeat is due at `now_s` [s]; the heartbeat then counts as sent."""
        if now_s < self._next_s:
            return False
        on_time_s = self._next_s + self._period_s
        self._next_s = on_time_s if on_time_s > now_s else now_s + self._period_s
        return True


class HeartbeatConsumer:
    """Monitor of one node's heartbeat.

    Monitoring begins with the first heartbeat (CiA 301, 7.2.8.3.2) or with `start`.

    Attributes:
        state: The state in the last heartbeat, None before the first.
        lost: True if `has_expired` has noticed a timeout and no heartbeat has come since.
        guarded: True if the node uses life guarding; an answer whose toggle bit has not changed is
            then ignored.
    """

    def __init__(self, timeout_s: float, *, guarded: bool = False) -> None:
        self._timeout_s = timeout_s
        self.guarded = guarded
        self._toggle = -1
        self._last_s: float | None = None
        self.state: int | None = None
        self.lost = False

    def start(self, now_s: float) -> None:
        """Begin to monitor at `now_s` [s], even before the first heartbeat."""
        self._last_s = now_s
        self.lost = False
        self._toggle = -1

    def note_heartbeat(self, state: int, now_s: float, toggle: int = 0) -> None:
        """Process a heartbeat, or an answer to life guarding, that arrived at `now_s` [s]."""
        if self.guarded and toggle == self._toggle:
            return
        self._toggle = toggle
        self.state = state
        self._last_s = now_s
        self.lost = False

    def has_expired(self, now_s: float) -> bool:
        """Return True, once, if the node has been silent for longer than the timeout."""
        if self.lost or self._last_s is None or now_s - self._last_s <= self._timeout_s:
            return False
        self.lost = True
        return True
