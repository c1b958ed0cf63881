"""The root of the command line: which commands there are, and how the program ends.

A command's module is imported when it is called, so that `rid-daq --help` and `rid-daq runs` do
not wait for numerics that they do not use. This is the one place that catches `RidDaqError`,
and what says that the computer lacks memory, room, files or processes.
"""

from __future__ import annotations

import importlib
import os
import shutil
import signal
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import FrameType
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperCommand, TyperGroup

from config.errors import RecordingError, RidDaqError, with_notes
from config.process.shortage import as_named, require_memory
from config.process.termination import TERMINATION, ending_signals, signals_deferred
from rid_daq.operations.catalogue import CATALOGUE
from rid_daq.terminal.console import Console, documents_written, output_error, printable
from rid_daq.terminal.exit_codes import ExitCode, exit_code_of
from rid_daq.terminal.fitted import fitted
from rid_daq.terminal.option_sections import SectionedCommand

# Small factorisations gain nothing from threads of BLAS, and lose much where the cores are busy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

COMMAND_GROUPS: dict[str, dict[str, str]] = {
    "Begin": {
        "demo": "the whole story on the bundled simulated cell, with a report, no hardware",
        "init": "write a commented cell, robot and motion to start from",
        "docs": "the documentation, in the browser: guides, reference, theory",
    },
    "Cell": {
        "check": "preflight: every device, every safety setting; any red means no motion",
        "axes": "test direction, encoder and gear of every axis, before the first motion",
        "jog": "move one joint at a time, or go to the home pose, while a key is held",
        "drives": "keep what the drives hold, put it back, undo what a run wrote",
        "mock": "serve a cell's simulated devices on their bus until stopped",
        "plate": "zero the force plate under the robot",
        "stop": "quick stop of whatever session is running on this machine",
    },
    "Experiment": {
        "design": "choose an excitation, verify it against the limits, write the motion file",
        "record": "run a motion on a cell and record it",
        "import": "someone else's recording (CSV, ROS bag) into a run folder",
        "average": "cut a run into periods, reject bad ones, average the rest",
    },
    "Identify": {
        "identify": "estimate the robot's parameters from one or more runs",
        "validate": "predict another run's torques and judge the error",
        "export": "a model as URDF, SDF, C, Python, CSV, JSON; a recording as CSV,"
        " Parquet, MAT, MDF4",
        "report": "write a run's report again from its results",
    },
    "Payload": {
        "payload": "identify what the robot carries (`payload CELL`); load data for its controller",
        "sensitivity": "what wrong knowledge of the robot does to a payload's estimate",
    },
    "Path": {
        "stream": "follow a path more closely, live: from a file or from another program",
    },
    "Runs": {
        "runs": "list the runs, and check that their files are unchanged",
    },
    "Service": {
        "serve": "cells as a service: jobs, runs and a workbench in the browser",
        "token": "let a program or a device in to a service of this computer",
    },
}
"""Every command and its one line in the help; the module is `rid_daq.commands.<name>`.

A command that has commands of its own is a `typer.Typer` named `group` in its module.
"""

for _name, _entry in CATALOGUE.items():
    COMMAND_GROUPS[_entry.section][_name] = _entry.summary

COMMANDS = {name: line for group in COMMAND_GROUPS.values() for name, line in group.items()}


WIDEST_HELP = 120  # columns: longer lines are hard to read; a narrower terminal is kept to
_WITHOUT_NUMERICS = frozenset({"docs", "init", "report", "runs", "stop", "token"})
_NUMERICS_BYTES = 750 << 20  # of address space, of which about half is used


class LazyCommands(TyperGroup):
    """The root group: imports `rid_daq.commands.<name>` when that command is called."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        names: Any = dict.fromkeys(COMMANDS)
        self.commands = names  # for lists and "did you mean"; get_command fills them in
        self._named_only = False

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Import and return one command, or None where there is none of that name."""
        if cmd_name not in COMMANDS:
            return None
        if self._named_only:
            return TyperCommand(cmd_name, short_help=COMMANDS[cmd_name], rich_markup_mode=None)
        # `import` is a word of the language, so its module is import_.
        module_name = "import_" if cmd_name == "import" else cmd_name
        if cmd_name not in _WITHOUT_NUMERICS:
            require_memory(_NUMERICS_BYTES)
        with signals_deferred():  # an exception inside of pydantic's modules becomes another one
            if cmd_name in CATALOGUE:
                from rid_daq.command_line.typer_command import TyperOperation

                return TyperOperation(cmd_name, COMMANDS[cmd_name], WIDEST_HELP)
            module = importlib.import_module(f"rid_daq.commands.{module_name}")
        found = getattr(module, "group", None) or getattr(module, module_name)
        if isinstance(found, typer.Typer):  # a command with commands of its own
            return typer.main.get_command(found)
        single = typer.Typer(add_completion=False, rich_markup_mode=None)
        single.command(name=cmd_name, cls=SectionedCommand)(found)
        return typer.main.get_command(single)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the list of commands without importing any of them."""
        width = max(map(len, COMMANDS))
        for title, commands in COMMAND_GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(name.ljust(width), line) for name, line in commands.items()])

    def shell_complete(self, ctx: Any, incomplete: str) -> Any:
        """Return what a word may become, without importing any command."""
        self._named_only = True
        try:
            return super().shell_complete(ctx, incomplete)
        finally:
            self._named_only = False


root = typer.Typer(
    cls=LazyCommands,
    rich_markup_mode=None,
    context_settings={"max_content_width": WIDEST_HELP},
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    help="Measure a robot's dynamics: drives, recordings, identification, validation, reports."
    " CELL is a bundled name (ir361, kr15) or a path to a cell file. This program is not a safety"
    " function: the cell's own emergency stop is required.",
)


def _show_version(asked: bool) -> None:
    if asked:
        from rid_daq.session.versions import program_version

        typer.echo(program_version())
        raise typer.Exit


@root.callback()
def _root(
    _version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    pass


def run(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit code; messages go to stderr.

    Parameters
    ----------
    arguments
        The words after the program's name.
    """
    written = documents_written()
    command = typer.main.get_command(root)
    ending = ending_of(lambda: command(args=list(arguments), prog_name="rid-daq"))
    if ending.said:
        named = f" [{ending.refusal}]" if ending.refusal else ""
        message = f"rid-daq: {printable(ending.message)}{named}"
        columns = shutil.get_terminal_size().columns if sys.stderr.isatty() else None
        typer.echo(message if columns is None else fitted(message, columns), err=True)
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


@dataclass(frozen=True)
class Ending:
    """How a command ended.

    Attributes
    ----------
    code : int
        Its exit code.
    kind, message : str
        What ended it, and why; empty where nothing did.
    refusal : str
        Stable code of the error that ended it, `RID-AREA-NAME`; empty without one.
    said : bool
        Whether a person is told so here; else the command has said it.
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
    except typer.Exit as end:
        return Ending(end.exit_code, *_ending(end.exit_code))
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
        return as_named(error)
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
    typer.echo(f"rid-daq: standard output: {error.strerror}", err=True)
    return code or ExitCode.STORAGE
