"""`Keyboard`: detects the held key of a terminal by its repeats.

A terminal does not report the release of a key. A key counts as held from the second of two repeats
that follow each other within `DEAD_MAN_S`, until `DEAD_MAN_S` after the last repeat. Therefore a
short tap moves nothing, and neither does the first press, which is long before its first repeat. If
this program was suspended or busy, it may have missed a release. Then the key counts again only
after `DEAD_MAN_S` without a repeat, which is a release.
"""

from __future__ import annotations

import os
import select
import sys
import termios
import tty
from collections.abc import Callable
from typing import Any

from acquisition.hold_to_run.dead_man import DEAD_MAN_S
from acquisition.hold_to_run.held_key import KeyPress
from config.errors import PreflightError
from config.process.safety_clock import safety_now_s

_ALIKE = {"=": "+", "_": "-"}
"""Characters of the same key, with and without the shift key."""


class Keyboard:
    """Reader of a terminal's keys within a `with` block, in which the terminal does not show them.

    Args:
        tapped: Called with every key, held or not.
        now_s: Clock for key repeats [s].

    Raises:
        PreflightError: On entering the block: standard input is not a terminal.
    """

    def __init__(
        self,
        tapped: Callable[[str], None] = lambda _key: None,
        now_s: Callable[[], float] = safety_now_s,
    ) -> None:
        self._tapped = tapped
        self._now_s = now_s
        self._input = -1
        self._before: list[Any] = []
        self._key, self._came_s, self._held = "", -1.0, False
        self._presses = 0
        self._polled_s = now_s()
        self._release_missed = False  # a release may have been missed

    def __enter__(self) -> Keyboard:
        require_keyboard()
        self._input = sys.stdin.fileno()
        self._before = termios.tcgetattr(self._input)
        tty.setcbreak(self._input)
        return self

    def __exit__(self, *_: object) -> None:
        # discard surplus keys, so that they do not answer the next question
        termios.tcsetattr(self._input, termios.TCSAFLUSH, self._before)

    def begin(self) -> None:
        """Accept keys that are pressed from now on; a held key must be released first."""
        self._held = False
        self._release_missed = self._now_s() - self._came_s < DEAD_MAN_S

    def look(self) -> KeyPress | None:
        """Return the key that is held now; None if no key is held."""
        typed = b""
        while select.select([self._input], [], [], 0.0)[0] and (more := os.read(self._input, 1024)):
            typed += more
        keys = typed.decode(errors="replace")
        self._detect_missed_release(len(keys))
        for key in keys[:-1]:
            self._tapped(_ALIKE.get(key, key))
        if keys:
            self.take(keys[-1])
        return self.held

    def _detect_missed_release(self, came: int) -> None:
        """Detect that a release may have been missed because this program was busy."""
        now_s = self._now_s()
        paused = now_s - self._polled_s >= DEAD_MAN_S
        silent = now_s - self._came_s >= DEAD_MAN_S
        self._polled_s = now_s
        if came and (paused or (silent and came > 1)):
            self._release_missed = True
        elif silent:
            self._release_missed = False

    @property
    def held(self) -> KeyPress | None:
        """The key that is held now, according to the received keys."""
        until_s = self._came_s + DEAD_MAN_S
        if not self._held or self._now_s() >= until_s:
            return None
        return KeyPress(self._key, self._presses, until_s)

    def take(self, key: str) -> None:
        """Process a received key; several keys received at once after a pause count as one."""
        key, now_s = _ALIKE.get(key, key), self._now_s()
        held = key == self._key and now_s - self._came_s < DEAD_MAN_S and not self._release_missed
        if held and not self._held:
            self._presses += 1
        self._key, self._came_s, self._held = key, now_s, held
        self._tapped(key)


def require_keyboard() -> None:
    """Raise an error if no key can be held.

    Raises:
        PreflightError: Standard input is not a terminal.
    """
    if not sys.stdin.isatty():
        raise PreflightError(
            "the robot moves only while a key is held, and standard input is not a terminal: run"
            " the command in a terminal",
            code="RID-KEY-NEEDED",
        )
