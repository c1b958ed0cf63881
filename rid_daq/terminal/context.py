"""`Context`: interface of an operation to its user; a console of a terminal or of a worker."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol, TypeVar

if TYPE_CHECKING:
    from acquisition.hold_to_run.dead_man_thread import KeySource
    from acquisition.task.service_beat import ServiceBeat
    from rid_daq.blocks.block import AnyBlock
    from rid_daq.terminal.job_events import MotionEvent, SessionState

T = TypeVar("T")


@dataclass(frozen=True)
class Controls:
    """Words for the controls with which a user moves a robot: keys of a terminal, or buttons.

    Attributes:
        kind: Kind of control.
        hold: Name of the control that must be held.
        end: Name of the control that ends the motion.
    """

    kind: str
    hold: str
    end: str


KEYS: Final = Controls("key", "SPACE", "q")
BUTTONS: Final = Controls("button", "the button", "Finish")
"""The buttons of `rid_daq/workbench/static/hold_pad.js`."""


class Progress(Protocol):
    """Progress display: the amount done, and one line of status."""

    def update(self, done: float, line: str) -> None:
        """Show the amount done, and the status `line`."""


@contextmanager
def working(display: Display, title: str) -> Iterator[None]:
    """Show the title of a step whose progress is unknown, within a `with` block."""
    with display.progress(title, None, "steps") as shown:
        shown.update(0.0, "")
        yield


class Display(Protocol):
    """Shows the progress of a motion."""

    def say(self, text: str = "") -> None:
        """Show a sentence before the result is available, such as the next step."""
        ...

    def progress(
        self, title: str, total: float | None, unit: str
    ) -> AbstractContextManager[Progress]:
        """Show the progress of a long step; `total` is None if it is unknown."""
        ...

    def announce_motion(self, motion: MotionEvent) -> None:
        """Announce that a motion begins."""
        ...


class Context(Display, Protocol):
    """Interface of an operation to its user: progress, announcements, questions, held keys."""

    @property
    def service(self) -> ServiceBeat | None:
        """Heartbeat of the service that started the operation; None without a service."""
        ...

    @property
    def operator(self) -> str:
        """Name of the person or program that started the operation; empty if unknown."""
        ...

    @property
    def as_json(self) -> bool:
        """True if programs read the output, and not people."""
        ...

    @property
    def is_terminal(self) -> bool:
        """True if a person reads the output on a terminal."""
        ...

    @property
    def can_ask(self) -> bool:
        """True if a user can be asked."""
        ...

    def verdict(self, passed: bool | None, text: str) -> None:
        """Show the verdict of one of several steps."""
        ...

    def result(self, document: Mapping[str, object], blocks: Iterable[AnyBlock]) -> None:
        """Show facts that are needed before the operation ends, such as an address."""
        ...

    def ask(
        self,
        question: str,
        understood: Callable[[str], T],
        choices: Sequence[tuple[str, str]] = (),
    ) -> T:
        """Ask the user until `understood` accepts the answer, and return its result."""
        ...

    def confirm(self, question: str) -> bool:
        """Ask the user for yes or no."""
        ...

    @property
    def controls(self) -> Controls:
        """Words for the controls that the user holds."""
        ...

    def require_keys(self, *, simulated: bool) -> None:
        """Raise `PreflightError` if the user cannot hold keys, or not safely."""
        ...

    def keys(self, tapped: Callable[[str], None]) -> AbstractContextManager[KeySource]:
        """Return a reader of the held key; it calls `tapped` with every key."""
        ...

    def announce_state(self, session: str, state: SessionState, text: str) -> None:
        """Announce the next state of a payload session; `text` describes the state."""
        ...

    def announce_warm_up(
        self, joints: Sequence[str], power_w: Sequence[Sequence[float]], settled_percent: float
    ) -> None:
        """Announce the power of the joints in further periods of a warm-up."""
        ...
