"""`Pilot`: turns a held key into presses of the dead-man, each along a line that was looked at."""

from __future__ import annotations

import threading
from abc import abstractmethod
from collections.abc import Callable
from typing import Final, Protocol

from acquisition.hold_to_run.dead_man import DeadMan
from acquisition.hold_to_run.held_key import Held
from acquisition.hold_to_run.line import HoldLine
from config.arrays import FloatArray
from config.process.safety_clock import safety_now_s

LOOK_S: Final = 0.01


class Keys(Protocol):
    """Whatever has keys to hold: a keyboard, or the button of a page."""

    @abstractmethod
    def begin(self) -> None:
        """Let keys count that are pressed from now on: the robot is at rest and ready to move."""

    @abstractmethod
    def look(self) -> Held | None:
        """Return which key is held now, None where none is."""


Plan = Callable[[str, FloatArray], HoldLine | None]
"""Says which line a key that is held leads along from a pose; None where it leads nowhere."""


class Pilot:
    """Looks at keys in a thread of its own for as long as the `with` lasts.

    When the thread ends, by an error too, no more signs of a held key come: the robot rests.

    Args:
        dead_man: What the cyclic task obeys.
        joints: Of the robot.
        keys: What is held.
        plan: What that means.
        until: Shape (joints,). The pose that ends the motion, once the robot rests there [rad or
            m].
        ready: Told where the robot is held at rest, once a key would move it.
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
        self._pressed = 0  # the press that was looked at
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
                self.look()
        except BaseException as error:
            self._error = error
            self._dead_man.finish()

    def look(self) -> None:
        """Look once at the keys, and tell the dead-man."""
        pose = self._dead_man.resting(self._joints)
        if pose is not None and self._ready is not None:
            self._ready(pose)
            self._ready = None
            self._keys.begin()
        if pose is not None and self._until is not None and (pose == self._until).all():
            self._dead_man.finish()
        held = self._keys.look()
        if held is None or held.press != self._pressed:
            self._dead_man.release()
            self._pressed = 0
        elif self._pressed:
            self._dead_man.hold(held.until_s)
            return
        if held is None or pose is None:  # no key; or it slows down still, or has not begun
            return
        line = self._plan(held.key, pose)
        still = self._keys.look()  # looking at the line takes its time
        if still is None or still.press != held.press:
            return
        self._pressed = held.press
        if line is not None and not line.is_empty:
            self._dead_man.press(line, still.until_s)


class HeldForGood:
    """A key that is held for as long as it is asked: for a simulated cell that nobody stands at."""

    def __init__(self, key: str) -> None:
        self._key = key

    def begin(self) -> None:
        """Do nothing."""

    def look(self) -> Held:
        """Return that the key is held."""
        return Held(self._key, 1, safety_now_s())
