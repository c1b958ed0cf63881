"""The program: call a command line, and report how it ended.

A command that fails raises a `RidDaqError`, or the system's error about a lack of memory, disk
space, files or processes. This module turns the error into a message and an exit code.
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

# BLAS threads do not speed up small factorisations, and slow them down on busy cores.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def run(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit code; messages go to stderr.

    Args:
        arguments: The words after the program's name.
    """
    written = documents_written()
    ending = ending_of(lambda: _call(list(arguments)))
    if ending.must_print:
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
    """Call the command of a command line, or answer a shell's request for completions.

    Raises:
        SystemExit: The command ended with another exit code, or early, such as a help page.
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
        raise SystemExit(
            ExitCode.DONE
        ) from None  # the reader of a pipe, such as a pager, has ended


def _output_is_closed() -> bool:
    """Return True if standard output is a pipe without a reader."""
    poll = select.poll()
    poll.register(sys.stdout.fileno(), select.POLLOUT)
    return any(event & select.POLLERR for _, event in poll.poll(0))


@dataclass(frozen=True)
class Ending:
    """End of a command, as exit code and message.

    Attributes:
        code: Exit code.
        kind: Class of the error, or kind of the ending; empty if the command succeeded.
        message: Reason of the ending; empty if the command succeeded.
        refusal: Stable code of the error, `RID-AREA-NAME`; empty without one.
        must_print: True if `run` must print the message; False if the command has printed it.
    """

    code: int
    kind: str = ""
    message: str = ""
    refusal: str = ""
    must_print: bool = False


def ending_of(command: Callable[[], object]) -> Ending:
    """Call a command and return how it ended; programming errors are raised."""
    try:
        command()
    except Exception as caught:
        error = _as_program_error(caught)
        code, kind = int(exit_code_of(error)), type(error).__name__
        return Ending(code, kind, str(error), error.refusal, must_print=True)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(ExitCode.DONE)
        kind, message = _reported_ending(code)
        return Ending(
            code, kind, with_notes(message, end), must_print=isinstance(end, _Interrupted)
        )
    return Ending(ExitCode.DONE)


def _reported_ending(code: int) -> tuple[str, str]:
    """Return kind and message of the end of a command that has printed its own message."""
    return _ENDINGS.get(code, ("Failure", "see the exit code")) if code else ("", "")


_ENDINGS: dict[int, tuple[str, str]] = {
    ExitCode.USAGE: ("UsageError", "invalid command line; see standard error"),
    ExitCode.INTERRUPTED: ("Interrupted", "interrupted"),
    ExitCode.TERMINATED: ("Terminated", "terminated"),
}
"""By exit code: kind and message for the JSON document that `run` writes if the command wrote none.
"""


class _Interrupted(SystemExit):
    """A signal ended the program while no motion or search handled signals itself."""


def _as_program_error(error: Exception) -> RidDaqError:
    """Return an error of the operating system as a `RidDaqError`; raise programming errors."""
    try:
        return named_error(error)
    except OSError:
        if not isinstance(error, OSError) or error.filename is None:
            raise
        return RecordingError(f"{error.filename}: {error.strerror}", code="RID-FILE-ACCESS")


def _end_once(number: int, _frame: FrameType | None) -> NoReturn:
    """End the program by an exception; ignore further signals, so that clean-up completes."""
    for other in TERMINATION:
        signal.signal(other, signal.SIG_IGN)
    raise _Interrupted(ExitCode.INTERRUPTED if number == signal.SIGINT else ExitCode.TERMINATED)


def end_by_signals() -> None:
    """Let signals end this program by an exception.

    The exception leaves every `with` block, so drives are disabled, files are closed and child
    processes are joined.
    """
    for number in ending_signals():
        signal.signal(number, _end_once)


def main() -> None:
    """Run the program with the arguments of the process (the `rid-daq` script)."""
    end_by_signals()
    sys.exit(_checked_output(run(sys.argv[1:])))


def _checked_output(code: int) -> int:
    """Return `code`, or `STORAGE` instead of 0 if standard output could not be written.

    A closed pipe is not an error.
    """
    error = output_error()
    if error is None or isinstance(error, BrokenPipeError):
        return code
    click.echo(f"rid-daq: cannot write to standard output: {error.strerror}", err=True)
    return code or ExitCode.STORAGE
