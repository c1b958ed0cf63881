"""`Challenges`: random values that one viewer must answer with while it holds a key.

An answer proves that the key was held after the challenge was issued, however long the answer was
on its way.
"""

from __future__ import annotations

import itertools
import secrets
from collections.abc import Callable
from typing import Final

from acquisition.hold_to_run.held_key import KeyMessage
from config.process.safety_clock import safety_now_s

SHORTEST_S: Final = 0.02
"""Least time between two challenges [s]: TCP sends a lost packet again as soon as three later ones
have arrived, so answers that follow quickly make a loss short."""

LONGEST_S: Final = 0.1
"""Most time between two challenges [s]."""

IDLE_S: Final = 0.05
"""Time between two challenges while nobody answers [s]."""

QUICK_S: Final = 0.06
"""Round trip below which a link is not filled by challenges in the shortest time [s]."""

OF_ROUND_TRIP: Final = 0.75
"""Time between two challenges on other links, as a share of the latest round trip."""

REMEMBERED: Final = 512
"""Challenges that are kept: of the last 10 s, so that a late answer's round trip is known."""

_connections = itertools.count(1)


class Challenges:
    """The challenges of one connection.

    Args:
        now_s: The clock that they are timed by [s].
    """

    def __init__(self, now_s: Callable[[], float] = safety_now_s) -> None:
        self._now_s = now_s
        self._connection = next(_connections)
        self._issued: dict[tuple[str, str], float] = {}
        self._round_trip_s = 0.0
        self._answered_s = 0.0

    def issue(self, job: str) -> dict[str, object]:
        """Return the message with a new challenge for whoever holds a key of a job."""
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

    def message(self, job: str, lease: str, told: dict[str, object]) -> KeyMessage | None:
        """Return what a viewer says about a key, with the age of the challenge that it answers.

        Args:
            job, lease: The ids of its job and of its lease.
            told: Its message: `held` or `tapped`, `sequence`, `challenge`.

        Returns:
            None if it is no message about a key.
        """
        challenge = told.get("challenge")
        answered = (job, challenge) if isinstance(challenge, str) else ("", "")
        sender = f"{self._connection}/{lease}"
        issued_s = self._issued.get(answered, 0.0)
        if issued_s:
            self._answered_s = self._now_s()
            self._round_trip_s = self._answered_s - issued_s
        return KeyMessage.from_order({**told, "sender": sender, "issued_s": issued_s})
