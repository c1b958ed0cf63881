"""The program: how a command line is called, and how it ends.

This is the one place that catches `RidDaqError`, and what says that the computer lacks memory,
room, files or processes.
"""

from __future__ import annotations

import os
import select
import shutil
import signal
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import FrameType
from typing import NoReturn

import click
from click.shell_completion import shell_complete

from config.errors import RecordingError, RidDaqError, with_notes
from config.process.shortage import named_error
from config.process.termination import TERMINATION, ending_signals
from rid_daq.command_line.completion import PROGRAM, VARIABLE
from rid_daq.command_line.root import Root
from rid_daq.terminal.console import Console, documents_written, make_printable, output_error
from rid_daq.terminal.exit_codes import ExitCode, exit_code_of
from rid_daq.terminal.text_wrapping import wrap_text

# Small factorisations gain nothing from threads of BLAS, and lose much where the cores are busy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def run(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit code; messages go to stderr.

    Args:
        arguments: The words after the program's name.
    """
    written = documents_written()
    ending = ending_of(lambda: _call(list(arguments)))
    if ending.said:
        named = f" [{ending.refusal}]" if ending.refusal else ""
        message = f"rid-daq: {make_printable(ending.message)}{named}"
        columns = shutil.get_terminal_size().columns if sys.stderr.isatty() else None
        click.echo(message if columns is None else wrap_text(message, columns), err=True)
    if ending.code and "--json" in arguments and documents_written() == written:
        problem: dict[str, object] = {
            "kind": ending.kind,
            "message": ending.message,
            "exit_code": ending.code,
        }
        if ending.refusal:
            problem["code"] = ending.refusal
        Console(as_json=True).document({"error": problem})
    return ending.code


def _call(words: list[str]) -> None:
    """Call the command of a command line, or answer the completion of a shell.

    Raises:
        SystemExit: It has ended with another exit code, or before its time, as a help does.
    """
    root = Root()
    if asked := os.environ.get(VARIABLE):
        raise SystemExit(shell_complete(root, {}, PROGRAM, VARIABLE, asked))
    try:
        with root.make_context(PROGRAM, words) as context:
            root.invoke(context)
    except click.UsageError as error:
        error.show()
        raise SystemExit(error.exit_code) from None
    except click.exceptions.Exit as end:
        raise SystemExit(end.exit_code) from None
    except KeyboardInterrupt:
        raise SystemExit(ExitCode.INTERRUPTED) from None
    except BrokenPipeError:
        if not _output_is_closed():
            raise
        raise SystemExit(ExitCode.DONE) from None  # the reader of a help wants no more of it


def _output_is_closed() -> bool:
    """Return True if standard output is a pipe without a reader."""
    poll = select.poll()
    poll.register(sys.stdout.fileno(), select.POLLOUT)
    return any(event & select.POLLERR for _, event in poll.poll(0))


@dataclass(frozen=True)
class Ending:
    """How a command ended.

    Attributes:
        code: Its exit code.
        kind, message: What ended it, and why; empty where nothing did.
        refusal: Stable code of the error that ended it, `RID-AREA-NAME`; empty without one.
        said: Whether a person is told so here; else the command has said it.
    """

    code: int
    kind: str = ""
    message: str = ""
    refusal: str = ""
    said: bool = False


def ending_of(command: Callable[[], object]) -> Ending:
    """Do what a command does, and return how it ended; mistakes of ours are raised."""
    try:
        command()
    except Exception as caught:
        error = _typed(caught)
        code, kind = int(exit_code_of(error)), type(error).__name__
        return Ending(code, kind, str(error), error.refusal, said=True)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(ExitCode.DONE)
        kind, message = _ending(code)
        return Ending(code, kind, with_notes(message, end), said=isinstance(end, _Interrupted))
    return Ending(ExitCode.DONE)


def _ending(code: int) -> tuple[str, str]:
    """Return kind and message of an ending that the command itself has told, by its exit code."""
    return _ENDINGS.get(code, ("Failure", "the exit code says what")) if code else ("", "")


_ENDINGS: dict[int, tuple[str, str]] = {
    ExitCode.USAGE: ("UsageError", "a mistyped command line; standard error says what"),
    ExitCode.INTERRUPTED: ("Interrupted", "interrupted"),
    ExitCode.TERMINATED: ("Terminated", "terminated"),
}
"""What a document says where a command ended before it could say anything itself."""


class _Interrupted(SystemExit):
    """A signal came where nothing else was ready for it."""


def _typed(error: Exception) -> RidDaqError:
    """Return what the system says of itself, or of a file, as an error; others are our mistakes."""
    try:
        return named_error(error)
    except OSError:
        if not isinstance(error, OSError) or error.filename is None:
            raise
        return RecordingError(f"{error.filename}: {error.strerror}", code="RID-FILE-ACCESS")


def _end_once(number: int, _frame: FrameType | None) -> NoReturn:
    """Begin to leave; further signals change nothing, so that the clean-up always completes."""
    for other in TERMINATION:
        signal.signal(other, signal.SIG_IGN)
    raise _Interrupted(ExitCode.INTERRUPTED if number == signal.SIGINT else ExitCode.TERMINATED)


def end_by_signals() -> None:
    """Let signals end this program by an exception.

    Leaving so closes every `with`: drives disabled, files closed, children joined.
    """
    for number in ending_signals():
        signal.signal(number, _end_once)


def main() -> None:
    """Run the program on the process's own arguments: the `rid-daq` script."""
    end_by_signals()
    sys.exit(_written_out(run(sys.argv[1:])))


def _written_out(code: int) -> int:
    """Return the exit code, or another one where what was said could not be written.

    Who closed a pipe wants to hear no more: that is no error.
    """
    error = output_error()
    if error is None or isinstance(error, BrokenPipeError):
        return code
    click.echo(f"rid-daq: standard output: {error.strerror}", err=True)
    return code or ExitCode.STORAGE
