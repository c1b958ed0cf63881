"""`JobConsole`: console of a job; it writes messages as events and asks the client questions."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, TypeVar

from pydantic import BaseModel

from config.errors import ConfigError, PreflightError
from config.process.safety_clock import safety_now_s
from rid_daq.blocks.block import AnyBlock, Table, Text
from rid_daq.blocks.picture import Picture
from rid_daq.blocks.plot import Plot
from rid_daq.terminal.console import Console, Progress, make_printable
from rid_daq.terminal.context import BUTTONS, Controls
from rid_daq.terminal.job_events import (
    AnswerEvent,
    AnyEvent,
    Choice,
    KeyRefusalEvent,
    MessageEvent,
    MotionEvent,
    ProgressEvent,
    QuestionEvent,
    ResultEvent,
    SessionState,
    StateEvent,
    VerdictEvent,
    WarmUpEvent,
)
from rid_daq.worker.orders import Orders

if TYPE_CHECKING:
    from acquisition.hold_to_run.dead_man_thread import KeySource
    from acquisition.task.service_beat import ServiceBeat

T = TypeVar("T")

PROGRESS_S: Final = 0.5
"""Minimum time between two progress events of one step [s]."""


class EventFile:
    """Event file of a job, one JSON document per line; new events are appended.

    Args:
        path: Path of the file, which is open until the `with` block ends.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("a", encoding="utf-8")
        self._writing = threading.Lock()

    def __enter__(self) -> EventFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def write(self, event: AnyEvent) -> None:
        """Write an event; any thread may call this, and readers see the event at once."""
        with self._writing:
            self._file.write(event.model_dump_json() + "\n")
            self._file.flush()


@dataclass(frozen=True, kw_only=True)
class JobConsole(Console):
    """Console that writes a command's messages as events.

    Attributes:
        events: Event file of the job.
        orders: Source of answers and held keys.
        owner: Person or program that started the job.
    """

    events: EventFile
    orders: Orders
    owner: str = ""

    @property
    def is_terminal(self) -> bool:
        """False: this console is not a terminal."""
        return False

    @property
    def service(self) -> ServiceBeat | None:
        """Heartbeat of the service that has started this worker."""
        return self.orders.service

    @property
    def operator(self) -> str:
        """Person or program that started the job."""
        return self.owner

    def say(self, text: str = "") -> None:
        """Write a message."""
        self.events.write(MessageEvent(at_s=time.time(), text=_shown(text)))

    def verdict(self, passed: bool | None, text: str) -> None:
        """Write a verdict."""
        self.events.write(VerdictEvent(at_s=time.time(), passed=passed, text=_shown(text)))

    def result(
        self, document: Mapping[str, object] | BaseModel, blocks: Iterable[AnyBlock]
    ) -> None:
        """Write the result of an operation."""
        content: dict[str, object] = json.loads(self.as_text(document))
        shown = [
            _printable(_for_events(each).model_dump())
            for each in blocks
            if not isinstance(each, Plot)
        ]
        result = {"at_s": time.time(), "document": content, "blocks": shown}
        self.events.write(ResultEvent.model_validate(result))

    def announce_motion(self, motion: MotionEvent) -> None:
        """Write that a motion begins."""
        self.events.write(motion)

    def announce_state(self, session: str, state: SessionState, text: str) -> None:
        """Write that a payload session enters a state."""
        entered = StateEvent(at_s=time.time(), session=session, state=state, text=text)
        self.events.write(entered)

    def announce_warm_up(
        self, joints: Sequence[str], power_w: Sequence[Sequence[float]], settled_percent: float
    ) -> None:
        """Write the values of more periods of a warm-up."""
        power = tuple(tuple(map(float, period)) for period in power_w)
        self.events.write(
            WarmUpEvent(
                at_s=time.time(),
                joints=tuple(joints),
                power_w=power,
                settled_percent=settled_percent,
            )
        )

    @property
    def can_ask(self) -> bool:
        """True: a job waits until a client answers."""
        return True

    def ask(
        self,
        question: str,
        understood: Callable[[str], T],
        choices: Sequence[tuple[str, str]] = (),
    ) -> T:
        """Ask the client until the answer is valid; `Console.ask` describes the parameters.

        Raises:
            PreflightError: No answer can arrive any more.
        """
        text = question
        shown = tuple(Choice(label=label, text=text) for label, text in choices)
        while True:
            answer = self._answer("text", text, shown)
            try:
                return understood(answer)
            except ConfigError as error:
                text = f"{error}. {question}"

    def confirm(self, question: str) -> bool:
        """Ask the client for yes or no.

        Raises:
            PreflightError: No answer can arrive any more.
        """
        return self._answer("yes_no", question).strip().lower() in ("y", "yes")

    @property
    def controls(self) -> Controls:
        """Words for the buttons of the pages."""
        return BUTTONS

    def require_keys(self, *, simulated: bool) -> None:
        """Raise no error: a button of the page is the key, and the page answers challenges."""

    def keys(self, tapped: Callable[[str], None]) -> AbstractContextManager[KeySource]:
        """Return the source of the client's held key, for use in a `with` statement."""
        return self._held_keys(tapped)

    @contextmanager
    def _held_keys(self, tapped: Callable[[str], None]) -> Iterator[KeySource]:
        number = self.orders.next_question()

        def ask() -> None:
            self.events.write(
                QuestionEvent(at_s=time.time(), question=number, form="hold", text="")
            )

        with self.orders.receive_keys(tapped, self._refuse_key, ask):
            yield self.orders
        self.events.write(AnswerEvent(at_s=time.time(), question=number))

    def _refuse_key(self, text: str, round_trip_s: float | None) -> None:
        round_trip_ms = None if round_trip_s is None else round(1e3 * round_trip_s, 1)
        self.events.write(KeyRefusalEvent(at_s=time.time(), text=text, round_trip_ms=round_trip_ms))

    def _answer(
        self, form: Literal["text", "yes_no"], text: str, choices: tuple[Choice, ...] = ()
    ) -> str:
        number = self.orders.next_question()
        event = QuestionEvent(
            at_s=time.time(), question=number, form=form, text=text, choices=choices
        )
        self.events.write(event)
        answer = self.orders.wait_for_answer(number)
        self.events.write(AnswerEvent(at_s=time.time(), question=number))
        if answer is None:
            raise PreflightError(
                "no one answered the question: nothing more is moved", code="RID-ANSWER-NOBODY"
            )
        return answer

    @contextmanager
    def progress(self, title: str, total: float | None, unit: str) -> Iterator[Progress]:
        """Write the progress of a long step, at most twice a second, and its end."""
        yield _ProgressReporter(self.events, title, total, unit)


def _for_events(block: AnyBlock) -> AnyBlock:
    """Return a block as events contain it: tables as texts, pictures as a line."""
    if isinstance(block, Picture):
        return Text(text=block.line)
    return block.as_texts() if isinstance(block, Table) else block


def _shown(text: str) -> str:
    """Return a text with visible control characters, and paths as clients name them.

    A job runs in the service's folder, and clients name files relative to it.
    """
    return make_printable(text).replace(f"{Path.cwd()}/", "")


def _printable(value: Any) -> Any:
    """Return a value with the texts that clients see."""
    if isinstance(value, str):
        return _shown(value)
    if isinstance(value, dict):
        return {key: _printable(each) for key, each in value.items()}
    return [_printable(each) for each in value] if isinstance(value, (list, tuple)) else value


class _ProgressReporter:
    def __init__(self, events: EventFile, title: str, total: float | None, unit: str) -> None:
        self._events = events
        self._title, self._total, self._unit = title, total, unit
        self._next_s = 0.0

    def update(self, done: float, line: str) -> None:
        now_s = safety_now_s()
        if now_s < self._next_s and done != self._total:
            return
        self._next_s = now_s + PROGRESS_S
        event = ProgressEvent(
            at_s=time.time(),
            title=self._title,
            done=done,
            total=self._total,
            unit=self._unit,
            line=line,
        )
        self._events.write(event)
