"""`Orders`: what the service tells a worker, one line of JSON each on standard input.

Where the input ends the service is gone: the job is told to end as by SIGTERM, and a motion stops.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from typing import IO

from acquisition.hold_to_run.dead_man import DEAD_MAN_S
from acquisition.hold_to_run.pilot import Held


class Orders:
    """Reads orders in a thread of its own.

    Parameters
    ----------
    source : text stream
        Where they come from; its first line has been taken.
    now_s : callable
        The monotonic clock [s].
    """

    def __init__(self, source: IO[str], now_s: Callable[[], float] = time.monotonic) -> None:
        self._source = source
        self._now_s = now_s
        self._changed = threading.Condition()
        self._answers: dict[int, str] = {}
        self._questions = 0
        self._ended = False
        self._held: Held | None = None
        self._tapped: Callable[[str], None] = lambda _key: None

    def start(self) -> None:
        """Begin to read."""
        threading.Thread(target=self._read, name="orders", daemon=True).start()

    def next_question(self) -> int:
        """Return the number of a new question."""
        self._questions += 1
        return self._questions

    def wait_for_answer(self, number: int) -> str | None:
        """Return the answer to a question; None where none can come any more."""
        with self._changed:
            while number not in self._answers and not self._ended:
                self._changed.wait(0.2)  # so that signals are looked at
            return self._answers.get(number)

    def look(self) -> Held | None:
        """Return which key is held now, None where none is."""
        held = self._held
        return held if held is not None and self._now_s() < held.until_s else None

    @contextlib.contextmanager
    def taps_to(self, tapped: Callable[[str], None]) -> Iterator[None]:
        """Tell somebody of every key that comes, for as long as the `with` lasts."""
        self._tapped = tapped
        try:
            yield
        finally:
            self._tapped = lambda _key: None
            self._held = None

    def take(self, order: dict[str, object]) -> None:
        """Take one order: an answer, a key that is held, or one that was tapped."""
        match order:
            case {"answer": int(question)}:
                with self._changed:
                    self._answers[question] = str(order.get("text", ""))
                    self._changed.notify_all()
            case {"held": str(key)}:
                self._held = Held(key, self._now_s() + DEAD_MAN_S) if key else None
            case {"tapped": str(key)}:
                self._tapped(key)

    def _read(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            for line in self._source:
                self.take(json.loads(line))
        with self._changed:
            self._ended = True
            self._changed.notify_all()
        os.kill(os.getpid(), signal.SIGTERM)
