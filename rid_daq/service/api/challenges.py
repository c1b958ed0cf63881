"""`Challenges`: random values that a client must return while a person holds a key.

An answer proves that the key was held after the challenge was issued, even if the answer is
delayed.
"""

from __future__ import annotations

import itertools
import secrets
from collections.abc import Callable
from typing import Final

from acquisition.hold_to_run.held_key import KeyMessage
from config.process.safety_clock import safety_now_s

SHORTEST_S: Final = 0.02
"""Minimum time between two challenges [s]. TCP repeats a lost packet as soon as three later packets
have arrived, so frequent challenges shorten the gap after a lost packet.
"""

LONGEST_S: Final = 0.1
"""Maximum time between two challenges [s]."""

IDLE_S: Final = 0.05
"""Time between two challenges while the client sends no answers [s]."""

QUICK_S: Final = 0.06
"""Round-trip time below which the link is fast enough for a challenge every `SHORTEST_S` [s]."""

OF_ROUND_TRIP: Final = 0.75
"""Time between two challenges on slower links, as a fraction of the latest round-trip time."""

REMEMBERED: Final = 512
"""Number of stored challenges: those of the last 10 s, to know the round-trip time of late answers.
"""

_connections = itertools.count(1)


class Challenges:
    """Challenges of one connection.

    Args:
        now_s: Clock for the age of challenges [s].
    """

    def __init__(self, now_s: Callable[[], float] = safety_now_s) -> None:
        self._now_s = now_s
        self._connection = next(_connections)
        self._issued: dict[tuple[str, str], float] = {}
        self._round_trip_s = 0.0
        self._answered_s = 0.0

    def issue(self, job: str) -> dict[str, object]:
        """Return the message with a new challenge for the holder of a job's key."""
        value = secrets.token_urlsafe(12)
        self._issued[job, value] = self._now_s()
        while len(self._issued) > REMEMBERED:
            del self._issued[next(iter(self._issued))]
        return {"type": "challenge", "job": job, "value": value}

    @property
    def pause_s(self) -> float:
        """Time to the next challenge [s]."""
        if self._now_s() - self._answered_s > 5.0 * LONGEST_S:
            return IDLE_S
        if self._round_trip_s < QUICK_S:
            return SHORTEST_S
        return min(OF_ROUND_TRIP * self._round_trip_s, LONGEST_S)

    def parse_key_message(
        self, job: str, lease: str, document: dict[str, object]
    ) -> KeyMessage | None:
        """Return a client's message about a key, with the age of the challenge that it answers.

        Args:
            job, lease: Ids of the job and of the lease.
            document: The client's message: `held` or `tapped`, `sequence`, `challenge`.

        Returns:
            None if `document` is not a message about a key.
        """
        challenge = document.get("challenge")
        answered = (job, challenge) if isinstance(challenge, str) else ("", "")
        sender = f"{self._connection}/{lease}"
        issued_s = self._issued.get(answered, 0.0)
        if issued_s:
            self._answered_s = self._now_s()
            self._round_trip_s = self._answered_s - issued_s
        return KeyMessage.from_order({**document, "sender": sender, "issued_s": issued_s})
