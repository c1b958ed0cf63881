"""`Orders`: orders of the service to a worker, one line of JSON each on standard input.

This process decides if a held key counts, by its own clock (`HeldKey`). An order that waited in the
service, in the pipe or in a suspended process does not count. If standard input ends, the service
is gone: the job ends as by SIGTERM, and a motion stops.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import threading
from collections.abc import Callable, Iterator
from typing import IO, Final

from acquisition.hold_to_run.dead_man import DEAD_MAN_S
from acquisition.hold_to_run.held_key import (
    CHALLENGE_LIMIT_S,
    HeldKey,
    KeyMessage,
    KeyPress,
    KeyVerdict,
)
from acquisition.supervision.stop_reason import StopCode
from acquisition.task.service_beat import ServiceBeat
from config.errors import PreflightError
from config.process.safety_clock import safety_now_s

REPORT_INTERVAL_S: Final = 0.5
"""Minimum time between two explanations why a key does not count [s]."""

_AGAIN: Final = "release the button and press it again"
_REFUSALS: Final = {
    KeyVerdict.UNRELEASED: f"the button was held too early: {_AGAIN}",
    KeyVerdict.ELSEWHERE: "another page or program holds a button: that one must be released first",
    KeyVerdict.TAP_LOST: "a choice arrived too late and was ignored: choose again, then press",
}
_CODES: Final = {
    StopCode.SERVICE_LOST: "RID-SERVICE-LOST",
    StopCode.CLIENT_LOST: "RID-CLIENT-LOST",
}

Refused = Callable[[str, float | None], None]
"""Function that is called with the reason why a key does not count, and the round-trip time or the
time without a fresh message if that is the reason [s].
"""


class Orders:
    """Reads orders in a separate thread.

    Args:
        source: Source of the orders, after its first line.
        now_s: The clock with which the service issues challenges [s].
        service: Heartbeat of the service.
    """

    def __init__(
        self,
        source: IO[str],
        now_s: Callable[[], float] = safety_now_s,
        service: ServiceBeat | None = None,
    ) -> None:
        self.service = service
        self._source = source
        self._now_s = now_s
        self._changed = threading.Condition()
        self._answers: dict[int, str] = {}
        self._questions = 0
        self._ended = False
        self._judging = threading.Lock()
        self._key = HeldKey()
        self._reported = False  # True once the reason why this press does not count was reported
        self._next_s = 0.0
        self._tapped: Callable[[str], None] = lambda _key: None
        self._refused: Refused = lambda _text, _round_trip_s: None
        self._asks: Callable[[], None] = lambda: None

    def start(self) -> None:
        """Start the reading thread."""
        threading.Thread(target=self._read, name="orders", daemon=True).start()

    def next_question(self) -> int:
        """Return a new question's number, which the answer must contain."""
        self._questions += 1
        return self._questions

    def wait_for_answer(self, number: int) -> str | None:
        """Return the answer to a question; None if no answer can arrive any more.

        Raises:
            PreflightError: The service does not respond, or the lease of the motion has ended.
        """
        with self._changed:
            while True:
                self._require_service()
                if number in self._answers or self._ended:
                    return self._answers.get(number)
                self._changed.wait(0.2)  # wakes up regularly, so that signals are processed

    def _require_service(self) -> None:
        reason = None if self.service is None else self.service.reason(self._now_s())
        if reason is not None:
            raise PreflightError(f"{reason.text}; nothing more is moved", code=_CODES[reason.code])

    def begin(self) -> None:
        """Ask the client to hold a key; a key that is held from now on counts."""
        with self._judging:
            self._key.set_accepting(True)
        self._asks()

    def look(self) -> KeyPress | None:
        """Return the key that is held now, None if no key is held."""
        with self._judging:
            now_s = self._now_s()
            self._end_gap(now_s)
            return self._key.held(now_s)

    @contextlib.contextmanager
    def receive_keys(
        self, tapped: Callable[[str], None], refused: Refused, asks: Callable[[], None]
    ) -> Iterator[None]:
        """Process keys inside the `with` block; they count after `begin`.

        Args:
            tapped: Function that is called for every tapped key.
            refused: Function that is called once per press with the reason if the press does not
                count.
            asks: Function that asks the client to hold a key; `begin` calls it.
        """
        self._tapped, self._refused, self._asks = tapped, refused, asks
        try:
            yield
        finally:
            with self._judging:
                self._key.set_accepting(False)
            self._tapped, self._refused = lambda _key: None, lambda _text, _round_trip_s: None
            self._asks = lambda: None

    def take(self, order: dict[str, object]) -> None:
        """Process one order: an answer, or a message about a key."""
        match order:
            case {"answer": int(question)}:
                with self._changed:
                    self._answers[question] = str(order.get("text", ""))
                    self._changed.notify_all()
            case _ if (message := KeyMessage.from_order(order)) is not None:
                if self._judge(message) and message.tapped:
                    self._tapped(message.key)

    def _judge(self, message: KeyMessage) -> bool:
        """Return True if a key message counts; report the reason once per press if it does not."""
        with self._judging:
            now_s = self._now_s()
            self._end_gap(now_s)
            verdict = self._key.process(message, now_s)
            if verdict is KeyVerdict.COUNTS:
                self._reported = False
            elif verdict is KeyVerdict.LATE:
                self._say_late(now_s - message.issued_s if message.issued_s else None)
            elif verdict in _REFUSALS:
                self._say(_REFUSALS[verdict], None)
            return verdict is KeyVerdict.COUNTS

    def _end_gap(self, now_s: float) -> None:
        age_s = self._key.end_expired_press(now_s)
        if age_s is not None:
            self._say(
                f"link too slow: no fresh message from the held button for {1e3 * age_s:.0f} ms"
                f" (one is needed every {1e3 * DEAD_MAN_S:.0f} ms): {_AGAIN}",
                age_s,
            )

    def _say_late(self, round_trip_s: float | None) -> None:
        if round_trip_s is None:
            why = (
                "the message answers no challenge that the service sent on this connection for"
                " this job"
            )
        else:
            limit_ms = 1e3 * CHALLENGE_LIMIT_S
            why = (
                f"link too slow: round-trip time {1e3 * round_trip_s:.0f} ms, at most"
                f" {limit_ms:.0f} ms is allowed"
            )
        self._say(f"{why}: the button does not count; {_AGAIN}", round_trip_s)

    def _say(self, text: str, round_trip_s: float | None) -> None:
        """Report why a key does not count: at most once per press and per `REPORT_INTERVAL_S`."""
        now_s = self._now_s()
        if not self._reported and now_s >= self._next_s:
            self._reported, self._next_s = True, now_s + REPORT_INTERVAL_S
            self._refused(text, round_trip_s)

    def _read(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            for line in self._source:
                self.take(json.loads(line))
        with self._changed:
            self._ended = True
            self._changed.notify_all()
        os.kill(os.getpid(), signal.SIGTERM)
