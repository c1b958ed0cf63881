"""`Orders`: what the service tells a worker, one line of JSON each on standard input.

Keys are judged here by this process's own reading of the clock (`HeldKey`): an order that waited in
the service, in the pipe or in a suspended process does not count. When the input ends the service
is gone: the job is told to end as by SIGTERM, and a motion stops.
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

SAYING_S: Final = 0.5
"""Least time between two explanations of keys that do not count [s]."""

_AGAIN: Final = "let go and press again"
_REFUSALS: Final = {
    KeyVerdict.UNRELEASED: f"the key was held before it could count: {_AGAIN}",
    KeyVerdict.ELSEWHERE: "another page or program holds a key: it must let go first",
    KeyVerdict.TAP_LOST: "a choice came too late and was not taken: choose again, then press",
}
_CODES: Final = {
    StopCode.SERVICE_LOST: "RID-SERVICE-LOST",
    StopCode.CLIENT_LOST: "RID-CLIENT-LOST",
}

Refused = Callable[[str, float | None], None]
"""Told why a key does not count, and the link's round trip if it is the reason [s]."""


class Orders:
    """Reads orders in a thread of its own.

    Args:
        source: Where they come from; its first line has been taken.
        now_s: The clock by which the service issues challenges [s].
        service: Signs of life of the service.
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
        self._said = False  # why the present press does not count
        self._next_s = 0.0
        self._tapped: Callable[[str], None] = lambda _key: None
        self._refused: Refused = lambda _text, _round_trip_s: None
        self._asks: Callable[[], None] = lambda: None

    def start(self) -> None:
        """Begin to read."""
        threading.Thread(target=self._read, name="orders", daemon=True).start()

    def next_question(self) -> int:
        """Return the number of a new question."""
        self._questions += 1
        return self._questions

    def wait_for_answer(self, number: int) -> str | None:
        """Return the answer to a question; None where none can come any more.

        Raises:
            PreflightError: The service hangs, or the lease of the motion has ended: an answer comes
                too late.
        """
        with self._changed:
            while True:
                self._require_service()
                if number in self._answers or self._ended:
                    return self._answers.get(number)
                self._changed.wait(0.2)  # so that signals are looked at

    def _require_service(self) -> None:
        reason = None if self.service is None else self.service.reason(self._now_s())
        if reason is not None:
            raise PreflightError(f"{reason.text}; nothing more is moved", code=_CODES[reason.code])

    def begin(self) -> None:
        """Ask for keys, and let them count."""
        with self._judging:
            self._key.set_accepting(True)
        self._asks()

    def look(self) -> KeyPress | None:
        """Return which key is held now, None if there is none."""
        with self._judging:
            now_s = self._now_s()
            self._end_gap(now_s)
            return self._key.held(now_s)

    @contextlib.contextmanager
    def keys_to(
        self, tapped: Callable[[str], None], refused: Refused, asks: Callable[[], None]
    ) -> Iterator[None]:
        """Take keys for as long as the `with` lasts; they count from `begin` on.

        Args:
            tapped: Told of every key that is tapped.
            refused: Told once a press why it does not count, or no longer.
            asks: Asks for keys, once they count.
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
        """Take one order: an answer, or a message about a key."""
        match order:
            case {"answer": int(question)}:
                with self._changed:
                    self._answers[question] = str(order.get("text", ""))
                    self._changed.notify_all()
            case _ if (message := KeyMessage.from_order(order)) is not None:
                if self._judge(message) and message.tapped:
                    self._tapped(message.key)

    def _judge(self, message: KeyMessage) -> bool:
        """Return whether a message about a key counts; say once a press if it does not."""
        with self._judging:
            now_s = self._now_s()
            self._end_gap(now_s)
            verdict = self._key.process(message, now_s)
            if verdict is KeyVerdict.COUNTS:
                self._said = False
            elif verdict is KeyVerdict.LATE:
                self._say_late(now_s - message.issued_s if message.issued_s else None)
            elif verdict in _REFUSALS:
                self._say(_REFUSALS[verdict], None)
            return verdict is KeyVerdict.COUNTS

    def _end_gap(self, now_s: float) -> None:
        age_s = self._key.end_expired_press(now_s)
        if age_s is not None:
            self._say(
                f"link too slow: {1e3 * age_s:.0f} ms without a fresh sign of the held key"
                f" (one each {1e3 * DEAD_MAN_S:.0f} ms is needed): {_AGAIN}",
                age_s,
            )

    def _say_late(self, round_trip_s: float | None) -> None:
        if round_trip_s is None:
            why = "it answers no challenge that the service sent by this connection for this job"
        else:
            limit_ms = 1e3 * CHALLENGE_LIMIT_S
            why = (
                f"link too slow: {1e3 * round_trip_s:.0f} ms there and back, {limit_ms:.0f} ms at"
                " most"
            )
        self._say(f"{why}: the key does not count; {_AGAIN}", round_trip_s)

    def _say(self, text: str, round_trip_s: float | None) -> None:
        """Say once a press, and at most once in `SAYING_S`, why a key does not count."""
        now_s = self._now_s()
        if not self._said and now_s >= self._next_s:
            self._said, self._next_s = True, now_s + SAYING_S
            self._refused(text, round_trip_s)

    def _read(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            for line in self._source:
                self.take(json.loads(line))
        with self._changed:
            self._ended = True
            self._changed.notify_all()
        os.kill(os.getpid(), signal.SIGTERM)
