"""`MasterWatch`: detects in a simulated drive that its master is silent (CiA 301, 7.2.8.3)."""

from __future__ import annotations

import math

from drivers.canopen.frames import Frame
from drivers.canopen.heartbeat import guard_answer, parse_consumer_entry
from drivers.canopen.nmt import NmtState
from mock_hw.drive import objects as od
from mock_hw.drive.object_dictionary import ObjectDictionary
from mock_hw.drive.power_stage import DriveClock


class MasterWatch:
    """Heartbeat consumer (1016h) and life guarding (100Ch, 100Dh) of a simulated drive.

    Args:
        objects: The drive's objects.
        clock: The drive's clock.
        identity: Node id of the drive, and its profile, which states if it has life guarding.
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
        """Earliest time at which a timeout of a monitored node ends [s]."""
        return min(self._silent_s.values(), default=math.inf)

    def forget(self) -> None:
        """End all monitoring, as at a reset of the communication."""
        self._watched.clear()
        self._silent_s.clear()
        self._toggle = False

    def read_entries(self) -> None:
        """Read the entries of 1016h; all monitoring starts again."""
        entries = [self._objects[od.HEARTBEAT_CONSUMER, n] for n in range(1, od.CONSUMERS + 1)]
        self._watched = dict(filter(None, map(parse_consumer_entry, entries)))
        self._silent_s.clear()

    def receive_heartbeat(self, node_id: int, now_s: float) -> bool:
        """Process a heartbeat; return True if 1016h contains its node.

        The first heartbeat of a node starts its monitoring.
        """
        timeout_s = self._watched.get(node_id)
        if timeout_s is None:
            return False
        self._silent_s[node_id] = now_s + self._clock.true_duration_s(timeout_s)
        return True

    def answer(self, nmt: NmtState, now_s: float) -> Frame | None:
        """Return the answer to a request of life guarding; the first request starts the monitoring.

        The answer is None if the drive has no life guarding or sends a heartbeat.
        """
        if not self._guarded or self._objects[od.HEARTBEAT_PRODUCER]:
            return None
        life_ms = self._objects[od.GUARD_TIME] * self._objects[od.LIFE_TIME_FACTOR]
        if life_ms:
            self._silent_s[self._node_id] = now_s + self._clock.true_duration_s(1e-3 * life_ms)
        frame = guard_answer(self._node_id, nmt, self._toggle)
        self._toggle = not self._toggle
        return frame

    def count_silent(self, now_s: float) -> int:
        """Return the number of monitored nodes whose timeout has ended.

        The next message of such a node starts its monitoring again.
        """
        over = [node for node, due_s in self._silent_s.items() if now_s >= due_s]
        for node in over:
            del self._silent_s[node]
        return len(over)
