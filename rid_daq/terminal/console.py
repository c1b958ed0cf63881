"""Output of a command: sentences and tables for people, or one JSON document for programs."""

from __future__ import annotations

import getpass
import json
import re
import shlex
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass, is_dataclass
from typing import TYPE_CHECKING, Final, TypeVar

import click

from config.errors import ConfigError, PreflightError
from rid_daq.terminal.context import KEYS, Controls
from rid_daq.terminal.context import Progress as Progress
from rid_daq.terminal.progress_bar import ProgressBar, format_count
from rid_daq.terminal.text_wrapping import wrap_text

if TYPE_CHECKING:
    from pydantic import BaseModel
    from rich.console import Console as RichConsole

    from acquisition.hold_to_run.dead_man_thread import KeySource
    from acquisition.task.service_beat import ServiceBeat
    from rid_daq.blocks.block import AnyBlock
    from rid_daq.terminal.job_events import MotionEvent, SessionState

T = TypeVar("T")

_INVISIBLE = re.compile("[\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff]")


_WIDEST = 1 << 16  # assumed width of a terminal of unknown width [columns]


class _Output:
    """State of this process's standard output."""

    documents = 0
    refused: OSError | None = None
    bar: ProgressBar | None = None


_output = _Output()

JSON_HELP: Final = "Write one JSON document to stdout instead of text."

SERVICE_HELP: Final = (
    "Run this command on a service: `local` for the service on this computer, or https://HOST:PORT"
    " with a token in RID_DAQ_TOKEN. Paths are relative to the service's folder."
)


def make_printable(text: str) -> str:
    """Return text with visible control characters, except newline and tab."""
    return "".join(c if c.isprintable() or c in "\n\t" else _escape(c) for c in text)


def as_command(*words: object) -> str:
    """Return a command of this program as it is typed; names with spaces are quoted."""
    return f"rid-daq {shlex.join(map(str, words))}"


def output_error() -> OSError | None:
    """Return the first error of standard output; None if no error occurred."""
    return _output.refused


def documents_written() -> int:
    """Return the number of JSON documents that this process has written."""
    return _output.documents


def _write(text: str) -> None:
    """Write a line; store the first error of standard output, which must not end a motion."""
    try:
        if _output.bar is None:
            click.echo(text)
        else:
            _output.bar.say(text)
    except OSError as error:
        _output.refused = _output.refused or error


def _rich_console() -> RichConsole:
    """Return the console that writes on the terminal, above a progress bar if there is one."""
    if _output.bar is not None:
        return _output.bar.console
    from rich.console import Console as RichConsole

    return RichConsole()


def _escape(character: str) -> str:
    number = ord(character)
    return f"\\x{number:02x}" if number < 0x100 else f"\\u{number:04x}"


def _cell(text: str) -> str:
    return make_printable(text).replace("\n", "\\n").replace("\t", "\\t")


def _as_json(value: object) -> object:
    """Return a model or a dataclass as JSON values.

    Raises:
        TypeError: The value is neither of them.
    """
    from pydantic import BaseModel  # imported late, because it is slow

    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json", by_alias=True)
    raise TypeError(f"values of type {type(value).__name__} cannot be written as JSON")


@dataclass(frozen=True)
class Console:
    """Writes text for people to stdout, or, with `as_json`, JSON for programs.

    Colours and progress bars appear on terminals only; pipes and log files receive plain text.
    There are no colours if the environment variable NO_COLOR is set. While a progress bar is shown,
    other text appears above the bar.
    """

    as_json: bool = False

    @property
    def is_terminal(self) -> bool:
        """True if a person reads the output on a terminal."""
        return not self.as_json and sys.stdout is not None and sys.stdout.isatty()

    @property
    def service(self) -> ServiceBeat | None:
        """Heartbeat of the service that started the operation; None without a service."""
        return None

    @property
    def operator(self) -> str:
        """Name of this process's user; empty if the system knows no name."""
        try:
            return getpass.getuser()
        except (KeyError, OSError):  # no entry for this user id
            return ""

    @property
    def columns(self) -> int | None:
        """Width of the terminal; None if the output is not a terminal."""
        return shutil.get_terminal_size().columns if self.is_terminal else None

    def say(self, text: str = "") -> None:
        """Write a sentence for people; write nothing with `--json`."""
        if not self.as_json:
            columns = self.columns
            text = make_printable(text)
            _write(text if columns is None else wrap_text(text, columns))

    def next_step(self, *words: object, lead: str = "Next") -> None:
        """Write the command for the next step, in shell syntax, after `lead` and a colon."""
        self.say(f"{lead}: {as_command(*words)}")

    def verdict(self, passed: bool | None, text: str) -> None:
        """Write a verdict; green or red on a terminal."""
        if not self.is_terminal:
            self.say(text)
            return
        from rich.text import Text

        style = "bold" if passed is None else "bold green" if passed else "bold red"
        shown = wrap_text(make_printable(text), self.columns or _WIDEST)
        _rich_console().print(Text(shown, style=style), soft_wrap=True)

    def document(self, document: Mapping[str, object] | BaseModel) -> None:
        """Write the command's result as JSON; write nothing without `--json`."""
        if self.as_json:
            _output.documents += 1
            text = self.as_text(document)
            _write(_INVISIBLE.sub(lambda found: f"\\u{ord(found[0]):04x}", text))

    def result(
        self, document: Mapping[str, object] | BaseModel, blocks: Iterable[AnyBlock]
    ) -> None:
        """Write the result of an operation, for programs or for people.

        Args:
            document: Values for programs; if it is empty, no document is written.
            blocks: The same result for people.
        """
        from rid_daq.terminal.block_printer import (
            print_blocks,
        )  # imported late: the help needs no blocks

        if document:
            self.document(document)
        print_blocks(blocks, self)

    def as_text(self, document: Mapping[str, object] | BaseModel) -> str:
        """Return a document as JSON text."""
        return json.dumps(document, ensure_ascii=False, indent=2, allow_nan=False, default=_as_json)

    def table(
        self,
        columns: Sequence[str],
        rows: Sequence[Sequence[str]],
        red: Sequence[bool] | None = None,
        key: int = 1,
    ) -> None:
        """Write a table for people.

        If a terminal is too narrow for a table of values, the table appears in parts below each
        other.

        Args:
            columns: Names of the columns.
            rows: One sequence of cells per row, as many as `columns`.
            red: True for each row that is written in red.
            key: Number of leading columns that identify a row.
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
        """True if standard input is a terminal, so that a user can be asked."""
        return sys.stdin.isatty()

    def ask(
        self,
        question: str,
        understood: Callable[[str], T],
        choices: Sequence[tuple[str, str]] = (),
    ) -> T:
        """Ask the user on stderr until an answer is accepted.

        Args:
            understood: Returns the meaning of an answer; raises ConfigError for an invalid answer.
            choices: Answers, with label and text of each; a page shows them as buttons.

        Raises:
            PreflightError: The input ended without an answer.
        """

        def meaning(text: str) -> T:
            try:
                return understood(text)
            except ConfigError as error:
                raise click.BadParameter(str(error)) from None

        texts = ", ".join(f"{text} = {label}" for label, text in choices)
        shown = f"{question} ({texts})" if texts else question
        answer: T = _answer(lambda: click.prompt(shown, value_proc=meaning, err=True))
        return answer

    def confirm(self, question: str) -> bool:
        """Ask the user for yes or no on stderr.

        Raises:
            PreflightError: The input ended without an answer.
        """
        return _answer(lambda: click.confirm(question, err=True))

    @property
    def controls(self) -> Controls:
        """Words for the keys of a terminal."""
        return KEYS

    def require_keys(self, *, simulated: bool) -> None:
        """Raise an error if keys cannot be held on this terminal, or not safely.

        Args:
            simulated: True for a simulated cell, which may use a remote terminal.

        Raises:
            PreflightError: There is no keyboard, or there is a network between keyboard and real
                cell.
        """
        from rid_daq.terminal.keyboard import require_keyboard
        from rid_daq.terminal.remote_terminal import refuse_remote_terminal

        require_keyboard()
        if not simulated:
            refuse_remote_terminal()

    def keys(self, tapped: Callable[[str], None]) -> AbstractContextManager[KeySource]:
        """Return a reader of the held key, for use in a `with` block.

        Args:
            tapped: Called with every key, held or not.

        Raises:
            PreflightError: On entering the block: there is no keyboard.
        """
        from rid_daq.terminal.keyboard import Keyboard

        return Keyboard(tapped)

    def announce_motion(self, motion: MotionEvent) -> None:
        """Do nothing, because the progress display announces the motion to people."""

    def announce_state(self, session: str, state: SessionState, text: str) -> None:
        """Write the next state of a payload session.

        Args:
            session: Id of the session's folder.
            state: The next state.
            text: Description of the state.
        """
        self.say(text)

    def announce_warm_up(
        self, joints: Sequence[str], power_w: Sequence[Sequence[float]], settled_percent: float
    ) -> None:
        """Do nothing: on a terminal, the progress display shows the warm-up.

        Args:
            joints: Base to flange.
            power_w: Mean mechanical power of each joint, one row per period [W].
            settled_percent: Change between periods below which the robot counts as warm [%].
        """

    @contextmanager
    def progress(self, title: str, total: float | None, unit: str) -> Iterator[Progress]:
        """Show the progress of a long step and the time left.

        A terminal shows a progress bar. Other outputs get one line per tenth, or none if `total`
        is unknown (None). `--json` shows nothing.
        """
        if self.as_json:
            yield _Silent()
        elif self.is_terminal:
            with ProgressBar(title, total, unit).shown() as bar:
                outer, _output.bar = _output.bar, bar
                try:
                    yield bar
                finally:
                    _output.bar = outer
        else:
            yield _Lines(title, total, unit)


def _answer(ask: Callable[[], T]) -> T:
    try:
        return ask()
    except click.Abort:
        click.echo(err=True)  # end the line of the question
        raise PreflightError(
            "the input ended without an answer: no further motion was started",
            code="RID-ANSWER-NOBODY",
        ) from None


class _Silent:
    def update(self, done: float, line: str) -> None:
        """Show nothing."""


class _Lines:
    """Progress display with one line for each completed tenth of a step."""

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
