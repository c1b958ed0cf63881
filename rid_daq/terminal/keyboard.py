"""`Keyboard`: which key of a terminal is held, by its repeats; a terminal says no more than those.

A terminal has no word for a key that is let go. A key counts as held from the second of two
repeats that follow one another within `DEAD_MAN_S`, and no longer than that after the last: the
first press, which is long before its first repeat, and a tap move nothing. If this program was
suspended, or too busy to look, nobody knows whether the key was let go meanwhile: it counts only
after `DEAD_MAN_S` in which none came, which is a release.
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
from acquisition.hold_to_run.held_key import Held
from config.errors import PreflightError
from config.process.safety_clock import safety_now_s

_ALIKE = {"=": "+", "_": "-"}
"""What the same key sends without, or with, the shift key."""


class Keyboard:
    """A terminal's keys for as long as the `with` lasts, in which it shows none of them.

    Args:
        tapped: Told of every key that comes, held or not.
        now_s: The clock that keys are held by [s].

    Raises:
        PreflightError: On entering: standard input is no terminal.
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
        self._looked_s = now_s()
        self._unseen = False  # what may have been a release was not looked at

    def __enter__(self) -> Keyboard:
        require_keyboard()
        self._input = sys.stdin.fileno()
        self._before = termios.tcgetattr(self._input)
        tty.setcbreak(self._input)
        return self

    def __exit__(self, *_: object) -> None:
        # what was typed too much answers no question that comes next
        termios.tcsetattr(self._input, termios.TCSAFLUSH, self._before)

    def begin(self) -> None:
        """Let keys count that are pressed from now on; one that is held already does not."""
        self._held = False
        self._unseen = self._now_s() - self._came_s < DEAD_MAN_S

    def look(self) -> Held | None:
        """Return which key is held now, by what has come since the last look."""
        typed = b""
        while select.select([self._input], [], [], 0.0)[0] and (more := os.read(self._input, 1024)):
            typed += more
        keys = typed.decode(errors="replace")
        self._note_pause(len(keys))
        for key in keys[:-1]:
            self._tapped(_ALIKE.get(key, key))
        if keys:
            self.take(keys[-1])
        return self.held

    def _note_pause(self, came: int) -> None:
        """Note whether keys have come while nobody looked: a release among them was not seen."""
        now_s = self._now_s()
        paused = now_s - self._looked_s >= DEAD_MAN_S
        silent = now_s - self._came_s >= DEAD_MAN_S
        self._looked_s = now_s
        if came and (paused or (silent and came > 1)):
            self._unseen = True
        elif silent:
            self._unseen = False

    @property
    def held(self) -> Held | None:
        """Which key is held now, by what was taken."""
        until_s = self._came_s + DEAD_MAN_S
        if not self._held or self._now_s() >= until_s:
            return None
        return Held(self._key, self._presses, until_s)

    def take(self, key: str) -> None:
        """Take a key that has come; several at once, after a pause of this program, are one."""
        key, now_s = _ALIKE.get(key, key), self._now_s()
        held = key == self._key and now_s - self._came_s < DEAD_MAN_S and not self._unseen
        if held and not self._held:
            self._presses += 1
        self._key, self._came_s, self._held = key, now_s, held
        self._tapped(key)


def require_keyboard() -> None:
    """Refuse to begin where no key can be held.

    Raises:
        PreflightError: Standard input is no terminal.
    """
    if not sys.stdin.isatty():
        raise PreflightError(
            "a key must be held for the robot to move, and there is no keyboard here: run the"
            " command in a terminal",
            code="RID-KEY-NEEDED",
        )
