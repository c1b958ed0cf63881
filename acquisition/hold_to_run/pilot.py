"""`Pilot`: turns a held key into presses of the dead-man, each along a line that was looked at."""

from __future__ import annotations

import threading
import time
from abc import abstractmethod
from collections.abc import Callable
from typing import Final, NamedTuple, Protocol

from acquisition.hold_to_run.dead_man import DeadMan
from acquisition.hold_to_run.line import Line
from config.arrays import FloatArray

LOOK_S: Final = 0.01


class Held(NamedTuple):
    """A key that is held, and until when as far as is known, on the monotonic clock [s]."""

    key: str
    until_s: float


class Keys(Protocol):
    """Whatever has keys to hold: a keyboard, or the button of a page."""

    @abstractmethod
    def look(self) -> Held | None:
        """Return which key is held now, None where none is."""


Plan = Callable[[str, FloatArray], Line | None]
"""Says which line a key that is held leads along from a pose; None where it leads nowhere."""


class Pilot:
    """Looks at keys in a thread of its own for as long as the `with` lasts.

    When the thread ends, by an error too, no more signs of a held key come: the robot rests.

    Parameters
    ----------
    dead_man : DeadMan
        What the cyclic task obeys.
    joints : int
        Of the robot.
    keys : Keys
        What is held.
    plan : Plan
        What that means.
    until : ndarray, shape (joints,), optional
        The pose that ends the motion, once the robot rests there [rad or m].
    ready : callable
        Told where the robot is held at rest, once a key would move it.
    """

    def __init__(
        self,
        dead_man: DeadMan,
        joints: int,
        keys: Keys,
        plan: Plan,
        until: FloatArray | None = None,
        ready: Callable[[FloatArray], None] = lambda _pose: None,
    ) -> None:
        self._dead_man = dead_man
        self._joints = joints
        self._keys = keys
        self._plan = plan
        self._until = until
        self._ready: Callable[[FloatArray], None] | None = ready
        self._pressed = ""
        self._line: Line | None = None
        self._line_of = ""
        self._seen: FloatArray | None = None
        self._error: BaseException | None = None
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="rid-daq pilot", daemon=True)

    def __enter__(self) -> Pilot:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()
        self._dead_man.release()
        if self._error is not None:
            raise self._error

    def _run(self) -> None:
        try:
            while not self._over.wait(LOOK_S):
                self._look()
        except BaseException as error:
            self._error = error
            self._dead_man.finish()

    def _look(self) -> None:
        pose = self._dead_man.resting(self._joints)
        if pose is not None and self._ready is not None:
            self._ready(pose)
            self._ready = None
        if pose is not None and self._until is not None and (pose == self._until).all():
            self._dead_man.finish()
        held = self._keys.look()
        if held is None or held.key != self._pressed:
            self._dead_man.release()
            self._pressed = ""
        elif self._pressed:
            self._dead_man.hold(held.until_s)
            return
        if held is None or pose is None:  # no key; or it slows down still, or has not begun
            return
        line = self._line_along(held.key, pose)
        held = self._keys.look()  # looking at the line takes its time
        if held is None or held.key != self._line_of:
            return
        self._pressed = held.key
        if line is not None and not line.is_empty:
            self._dead_man.press(line, held.until_s)

    def _line_along(self, key: str, pose: FloatArray) -> Line | None:
        """Return what a key means here; it is looked at once, however long that takes."""
        if key != self._line_of or self._seen is None or (self._seen != pose).any():
            self._line = self._plan(key, pose)
            self._line_of, self._seen = key, pose
        return self._line


class HeldForGood:
    """A key that is held for as long as it is asked: for a simulated cell that nobody stands at."""

    def __init__(self, key: str) -> None:
        self._key = key

    def look(self) -> Held:
        """Return that the key is held."""
        return Held(self._key, time.monotonic())
