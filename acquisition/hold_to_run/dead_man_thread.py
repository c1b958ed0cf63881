"""`DeadManThread`: turns held keys into presses of the dead-man, each along a checked line."""

from __future__ import annotations

import threading
from abc import abstractmethod
from collections.abc import Callable
from typing import Final, Protocol

from acquisition.hold_to_run.dead_man import DeadMan
from acquisition.hold_to_run.held_key import KeyPress
from acquisition.hold_to_run.line import HoldLine
from config.arrays import FloatArray
from config.process.safety_clock import safety_now_s

LOOK_S: Final = 0.01


class KeySource(Protocol):
    """Source of held keys: a keyboard, or a button on a page."""

    @abstractmethod
    def begin(self) -> None:
        """Accept keys that are pressed from now on: the robot is at rest and ready to move."""

    @abstractmethod
    def look(self) -> KeyPress | None:
        """Return the key that is held now; None if no key is held."""


LinePlanner = Callable[[str, FloatArray], HoldLine | None]
"""Returns the line that a held key requests from a pose; None if the key requests no motion."""


class DeadManThread:
    """Thread that polls the keys and updates the dead-man while the `with` block is active.

    If the thread ends, also by an error, no key counts as held any more and the robot stops.

    Args:
        dead_man: Shared memory that the cyclic task reads.
        joints: Number of joints.
        keys: Source of held keys.
        plan: Returns the straight motion that a key requests.
        until: Shape (joints,). Pose that ends the motion once the robot rests there [rad or m].
        ready: Called once with the pose at rest, as soon as keys can move the robot.

    Any error of `keys`, `plan` or `ready` ends the thread; the end of the `with` block raises it.
    """

    def __init__(
        self,
        dead_man: DeadMan,
        joints: int,
        keys: KeySource,
        plan: LinePlanner,
        until: FloatArray | None = None,
        ready: Callable[[FloatArray], None] = lambda _pose: None,
    ) -> None:
        self._dead_man = dead_man
        self._joints = joints
        self._keys = keys
        self._plan = plan
        self._until = until
        self._ready: Callable[[FloatArray], None] | None = ready
        self._pressed = 0  # number of the press in progress; 0 after its release
        self._error: BaseException | None = None
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="rid-daq pilot", daemon=True)

    def __enter__(self) -> DeadManThread:
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
        """Poll the keys once and update the dead-man."""
        pose = self._dead_man.rest_pose(self._joints)
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
        if held is None or pose is None:  # no key is held, or the robot is not at rest
            return
        line = self._plan(held.key, pose)
        still = self._keys.look()  # the key may have been released during the planning
        if still is None or still.press != held.press:
            return
        self._pressed = held.press
        if line is not None and not line.is_empty:
            self._dead_man.press(line, still.until_s)


class AlwaysHeldKey:
    """Key that is held permanently, for a simulated cell without a person."""

    def __init__(self, key: str) -> None:
        self._key = key

    def begin(self) -> None:
        """Do nothing."""

    def look(self) -> KeyPress:
        """Return the key, always in its first press."""
        return KeyPress(self._key, 1, safety_now_s())
