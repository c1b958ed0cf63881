"""`MasterWatch`: how a simulated drive notices that its master fell silent (CiA 301, 7.2.8.3)."""

from __future__ import annotations

import math

from drivers.canopen.frames import Frame
from drivers.canopen.heartbeat import guard_answer, parse_consumer_entry
from drivers.canopen.nmt import NmtState
from mock_hw.drive import objects as od
from mock_hw.drive.object_dictionary import ObjectDictionary
from mock_hw.drive.power_stage import DriveClock


class MasterWatch:
    """Heartbeats that are watched by 1016h, and life guarding by 100Ch and 100Dh.

    Args:
        objects: The drive's objects.
        clock: What it times by.
        identity: Its address, and whether its family has life guarding.
    """

    def __init__(
        self, objects: ObjectDictionary, clock: DriveClock, identity: od.SimulatedIdentity
    ) -> None:
        self._objects = objects
        self._clock = clock
        self._node_id = identity.node_id
        self._guarded = identity.profile.watch == "life_guarding"
        self._toggle = False
        self._watched: dict[int, float] = {}
        self._silent_s: dict[int, float] = {}

    @property
    def next_s(self) -> float:
        """When somebody will have been silent for too long [s]."""
        return min(self._silent_s.values(), default=math.inf)

    def forget(self) -> None:
        """Begin anew, as after a reset of the communication."""
        self._watched.clear()
        self._silent_s.clear()
        self._toggle = False

    def read_entries(self) -> None:
        """Take what 1016h says now."""
        entries = [self._objects[od.HEARTBEAT_CONSUMER, n] for n in range(1, od.CONSUMERS + 1)]
        self._watched = dict(filter(None, map(parse_consumer_entry, entries)))
        self._silent_s.clear()

    def hear(self, node_id: int, now_s: float) -> bool:
        """Take a heartbeat, and say if it is watched; that begins with the first one."""
        timeout_s = self._watched.get(node_id)
        if timeout_s is None:
            return False
        self._silent_s[node_id] = now_s + self._clock.lasts(timeout_s)
        return True

    def answer(self, nmt: NmtState, now_s: float) -> Frame | None:
        """Return the state to whoever asks for it; from the first question on the next is missed.

        A drive that sends its heartbeat does not answer.
        """
        if not self._guarded or self._objects[od.HEARTBEAT_PRODUCER]:
            return None
        life_ms = self._objects[od.GUARD_TIME] * self._objects[od.LIFE_TIME_FACTOR]
        if life_ms:
            self._silent_s[self._node_id] = now_s + self._clock.lasts(1e-3 * life_ms)
        frame = guard_answer(self._node_id, nmt, self._toggle)
        self._toggle = not self._toggle
        return frame

    def silent(self, now_s: float) -> int:
        """Return how many were silent for too long; they are watched again when they speak."""
        over = [node for node, due_s in self._silent_s.items() if now_s >= due_s]
        for node in over:
            del self._silent_s[node]
        return len(over)
