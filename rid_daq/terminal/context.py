"""`Context`: what an operation uses while it runs; a console of a terminal or of a worker."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    from acquisition.hold_to_run.pilot import Keys
    from acquisition.task.service_beat import ServiceBeat
    from rid_daq.blocks.block import AnyBlock
    from rid_daq.terminal.job_events import SessionState

T = TypeVar("T")


class Progress(Protocol):
    """A progress display: the amount done, and one line of status."""

    def update(self, done: float, line: str) -> None:
        """Show that `done` of the total is done; `line` is the status."""


class Display(Protocol):
    """Shows how a motion goes."""

    def say(self, text: str = "") -> None:
        """Show a sentence before the result is there, such as what happens next."""
        ...

    def progress(
        self, title: str, total: float | None, unit: str
    ) -> AbstractContextManager[Progress]:
        """Show the progress of a long step; `total` is None if it is unknown."""
        ...

    def begins(self, run: str, title: str, rows: int, rows_per_period: int | None) -> None:
        """Announce a motion: its run, its description, its number of cycles (0 if unknown)."""
        ...


class Context(Display, Protocol):
    """What an operation uses while it runs: progress, announcements, questions, held keys."""

    @property
    def service(self) -> ServiceBeat | None:
        """Signs of life of the service that ordered the operation; None without one."""
        ...

    @property
    def as_json(self) -> bool:
        """True if programs read what is shown, and not people."""
        ...

    @property
    def is_terminal(self) -> bool:
        """True if a person sees on a terminal what is shown."""
        ...

    @property
    def can_ask(self) -> bool:
        """True if a person can be asked."""
        ...

    def verdict(self, passed: bool | None, text: str) -> None:
        """Show the verdict of one step of several."""
        ...

    def result(self, document: Mapping[str, object], blocks: Iterable[AnyBlock]) -> None:
        """Show what programs and people must know before the operation ends, such as an address."""
        ...

    def ask(
        self,
        question: str,
        understood: Callable[[str], T],
        choices: Sequence[tuple[str, str]] = (),
    ) -> T:
        """Ask a person until `understood` accepts the answer, and return what it returns."""
        ...

    def confirm(self, question: str) -> bool:
        """Ask a person for yes or no."""
        ...

    def require_keys(self, *, simulated: bool) -> None:
        """Raise `PreflightError` if no key can be held here, or not safely."""
        ...

    def keys(self, tapped: Callable[[str], None]) -> AbstractContextManager[Keys]:
        """Return a reader of the held key; `tapped` is called with every key."""
        ...

    def enters(self, session: str, state: SessionState, text: str) -> None:
        """Announce the next state of a payload session; `text` says what is done in it."""
        ...

    def warms_up(
        self, joints: Sequence[str], power_w: Sequence[Sequence[float]], settled_percent: float
    ) -> None:
        """Announce further periods of a warm-up."""
        ...
