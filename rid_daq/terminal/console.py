"""What a command says: sentences and tables for people, or one JSON document for programs."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, TypeVar

import click

from config.errors import ConfigError, PreflightError
from rid_daq.terminal.context import Progress as Progress
from rid_daq.terminal.fitted import fitted
from rid_daq.terminal.progress_bar import MovingBar, format_count

if TYPE_CHECKING:
    from pydantic import BaseModel
    from rich.console import Console as RichConsole

    from acquisition.hold_to_run.pilot import Keys
    from acquisition.task.service_beat import ServiceBeat
    from rid_daq.blocks.block import AnyBlock
    from rid_daq.terminal.job_events import SessionState

T = TypeVar("T")

_INVISIBLE = re.compile("[\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff]")


_WIDEST = 1 << 16  # columns, where nobody knows how many


class _Output:
    """What this process has done with standard output."""

    documents = 0
    refused: OSError | None = None
    bar: MovingBar | None = None


_output = _Output()

JSON_HELP: Final = "Write one JSON document to stdout instead of text."

SERVICE_HELP: Final = (
    "Run this on a service: `local` for the one on this computer, or https://HOST:PORT with a token"
    " in RID_DAQ_TOKEN. Paths are relative to the service's folder."
)


def make_printable(text: str) -> str:
    """Return text with control characters made visible: it may come from a device or a file."""
    return "".join(c if c.isprintable() or c in "\n\t" else _escaped(c) for c in text)


def as_command(*words: object) -> str:
    """Return a command of this program as it is typed, names with spaces in quotes."""
    return f"rid-daq {shlex.join(map(str, words))}"


def output_error() -> OSError | None:
    """Return why standard output did not take what was written, the first time; None if it did."""
    return _output.refused


def documents_written() -> int:
    """Return how many documents this process has written for programs."""
    return _output.documents


def _write(text: str) -> None:
    """Write a line; a motion does not end because nobody takes what is said of it."""
    try:
        if _output.bar is None:
            click.echo(text)
        else:
            _output.bar.say(text)
    except OSError as error:
        _output.refused = _output.refused or error


def _rich_console() -> RichConsole:
    """Return what draws on the terminal: above a moving bar, where one is shown."""
    if _output.bar is not None:
        return _output.bar.console
    from rich.console import Console as RichConsole

    return RichConsole()


def _escaped(character: str) -> str:
    number = ord(character)
    return f"\\x{number:02x}" if number < 0x100 else f"\\u{number:04x}"


def _cell(text: str) -> str:
    return make_printable(text).replace("\n", "\\n").replace("\t", "\\t")


def _as_json(value: object) -> object:
    """Return a model as JSON has it.

    Raises:
        TypeError: It is none.
    """
    from pydantic import BaseModel  # takes longer to import than all else that says something

    if isinstance(value, BaseModel):
        return value.model_dump(mode="json", by_alias=True)
    raise TypeError(f"{type(value).__name__} is nothing that JSON has")


@dataclass(frozen=True)
class Console:
    """Writes to people on stdout, or, with `as_json`, to programs.

    Colours, moving bars and wide tables are for terminals only, and never with NO_COLOR's users'
    colours; what a pipe or a log file gets is plain text. What is said while a bar moves stands
    above it.
    """

    as_json: bool = False

    @property
    def is_terminal(self) -> bool:
        """Whether a person sees this as it is written."""
        return not self.as_json and sys.stdout is not None and sys.stdout.isatty()

    @property
    def service(self) -> ServiceBeat | None:
        """Signs of life of the service that has ordered what is done; None without one."""
        return None

    @property
    def columns(self) -> int | None:
        """How wide the terminal is; None where this is no terminal."""
        return shutil.get_terminal_size().columns if self.is_terminal else None

    def say(self, text: str = "") -> None:
        """Write a sentence for people; nothing with `--json`."""
        if not self.as_json:
            columns = self.columns
            text = make_printable(text)
            _write(text if columns is None else fitted(text, columns))

    def next_step(self, *words: object, lead: str = "Next") -> None:
        """Write a command that comes next, as a shell takes it, behind a word or two."""
        self.say(f"{lead}: {as_command(*words)}")

    def verdict(self, passed: bool | None, text: str) -> None:
        """Write the sentence that matters, green or red on a terminal."""
        if not self.is_terminal:
            self.say(text)
            return
        from rich.text import Text

        style = "bold" if passed is None else "bold green" if passed else "bold red"
        shown = fitted(make_printable(text), self.columns or _WIDEST)
        _rich_console().print(Text(shown, style=style), soft_wrap=True)

    def document(self, document: Mapping[str, object] | BaseModel) -> None:
        """Write the command's result for programs; nothing without `--json`."""
        if self.as_json:
            _output.documents += 1
            text = self.as_text(document)
            _write(_INVISIBLE.sub(lambda found: f"\\u{ord(found[0]):04x}", text))

    def result(
        self, document: Mapping[str, object] | BaseModel, blocks: Iterable[AnyBlock]
    ) -> None:
        """Write the result of an operation, for programs or for people.

        Args:
            document: Its numbers, for programs; nothing is written for them if it is empty.
            blocks: What people see of it.
        """
        from rid_daq.terminal.shown_blocks import show  # blocks are models: a help needs none

        if document:
            self.document(document)
        show(blocks, self)

    def as_text(self, document: Mapping[str, object] | BaseModel) -> str:
        """Return a document as JSON."""
        return json.dumps(document, ensure_ascii=False, indent=2, allow_nan=False, default=_as_json)

    def table(
        self,
        columns: Sequence[str],
        rows: Sequence[Sequence[str]],
        red: Sequence[bool] | None = None,
        key: int = 1,
    ) -> None:
        """Write a table for people, rows in red where told.

        On a terminal that is too narrow for it, in parts one under the other.

        Args:
            columns: The head.
            rows: One sequence of cells a row, as many as `columns`.
            red: One truth value a row.
            key: How many of the first columns say what a row is.
        """
        if self.as_json:
            return
        rows = [[_cell(cell) for cell in row] for row in rows]
        if self.is_terminal:
            from rid_daq.terminal.tables import print_table

            print_table(_rich_console(), columns, rows, red, key)
            return
        widths = [max(len(row[i]) for row in (columns, *rows)) for i in range(len(columns))]
        for row in (columns, *rows):
            cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
            self.say("  ".join(cells).rstrip())

    @property
    def can_ask(self) -> bool:
        """Whether somebody is there who can be asked."""
        return sys.stdin.isatty()

    def ask(
        self,
        question: str,
        understood: Callable[[str], T],
        choices: Sequence[tuple[str, str]] = (),
    ) -> T:
        """Ask a person, beside what programs read, until an answer is understood.

        Args:
            understood: Returns what an answer means; raises ConfigError where it means nothing.
            choices: Answers that a page shows as buttons: what each says, and its text.

        Raises:
            PreflightError: There is no answer: the input has ended.
        """

        def meaning(text: str) -> T:
            try:
                return understood(text)
            except ConfigError as error:
                raise click.BadParameter(str(error)) from None

        answer: T = _answered(lambda: click.prompt(question, value_proc=meaning, err=True))
        return answer

    def confirm(self, question: str) -> bool:
        """Ask a person for yes or no, beside what programs read.

        Raises:
            PreflightError: There is no answer: the input has ended.
        """
        return _answered(lambda: click.confirm(question, err=True))

    def require_keys(self, *, simulated: bool) -> None:
        """Refuse to begin if no key can be held, or not safely.

        Args:
            simulated: Whether the cell is: then a remote terminal will do.

        Raises:
            PreflightError: There is no keyboard, or a network is between it and a real cell.
        """
        from rid_daq.terminal.keyboard import require_keyboard
        from rid_daq.terminal.remote_terminal import refuse_remote_terminal

        require_keyboard()
        if not simulated:
            refuse_remote_terminal()

    def keys(self, tapped: Callable[[str], None]) -> AbstractContextManager[Keys]:
        """Return what says which key is held, for as long as its `with` lasts.

        Args:
            tapped: Told of every key that comes, held or not.

        Raises:
            PreflightError: On entering: there is no keyboard.
        """
        from rid_daq.terminal.keyboard import Keyboard

        return Keyboard(tapped)

    def begins(self, run: str, title: str, rows: int, rows_per_period: int | None) -> None:
        """Be told that a motion begins; what a person sees of it is its progress.

        Args:
            run: The id of its run.
            title: What is done, in a sentence.
            rows: How many cycles it has, 0 where nobody knows.
            rows_per_period: Of a periodic motion.
        """

    def enters(self, session: str, state: SessionState, text: str) -> None:
        """Write what a payload session does next.

        Args:
            session: The id of its folder.
            state: The state that it enters.
            text: What is done in it.
        """
        self.say(text)

    def warms_up(
        self, joints: Sequence[str], power_w: Sequence[Sequence[float]], settled_percent: float
    ) -> None:
        """Be told of more periods of a warm-up; what a person sees of it is its progress.

        Args:
            joints: Base to flange.
            power_w: What friction takes of each joint, one row a period [W].
            settled_percent: The change of a period that counts as warm [%].
        """

    @contextmanager
    def progress(self, title: str, total: float | None, unit: str) -> Iterator[Progress]:
        """Show how far a long step is, with the time that is left.

        On a terminal a moving bar; elsewhere a line a tenth; with `--json` nothing. `total` is None
        where nobody knows how long it is.
        """
        if self.as_json:
            yield _Silent()
        elif self.is_terminal:
            with MovingBar(title, total, unit).shown() as bar:
                outer, _output.bar = _output.bar, bar
                try:
                    yield bar
                finally:
                    _output.bar = outer
        else:
            yield _Lines(title, total, unit)


def _answered(ask: Callable[[], T]) -> T:
    try:
        return ask()
    except click.Abort:
        click.echo(err=True)  # the question's line has no end
        raise PreflightError(
            "nobody answered: nothing more is moved", code="RID-ANSWER-NOBODY"
        ) from None


class _Silent:
    def update(self, done: float, line: str) -> None:
        """Show nothing."""


class _Lines:
    """A line for each tenth that is done."""

    def __init__(self, title: str, total: float | None, unit: str) -> None:
        self._title, self._total, self._unit = title, total, unit
        self._shown = 0

    def update(self, done: float, line: str) -> None:
        if self._total is None:
            return
        tenth = int(10.0 * done / self._total) if self._total > 0 else 10
        if tenth > self._shown:
            self._shown = tenth
            amount = f"{format_count(done)} of {format_count(self._total)}"
            _write(f"{self._title}: {amount} {self._unit}  {line}")
