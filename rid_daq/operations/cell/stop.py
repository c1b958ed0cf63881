"""`stop`: quick stop of a session that runs on this computer."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from config.errors import ConfigError
from config.formats.bounded_file import read_file
from rid_daq.blocks.block import AnyBlock, Text, Verdict
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import Option
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.session.running_sessions import RunningSession
    from rid_daq.session.stopping import SessionStop

MOST_LISTED: Final = 9
_NAME: Final = re.compile(r"^name:[ \t]*[\"']?([\w.-]+)", re.MULTILINE)


class StopRequest(Request):
    """Stop the session that runs on this computer: quick stop of all axes, then power off.

    The command works from any terminal of the same user (root: for all users' sessions), even if
    the session is busy. The session keeps the rows that it has recorded. If several sessions run,
    name the cell, or choose from the list. If several sessions run and there is no terminal to
    choose, no session is stopped, and the exit code is 2. Exit code 0: the session confirmed the
    stop; 1: no session runs; 4: a session did not answer. This command is not an emergency stop.
    """

    cell: Annotated[
        str | None,
        Field(
            description="Cell to stop: its name or its file (default: the only session that runs)."
        ),
        Option(positional=True, metavar="[CELL]"),
    ] = None
    every: Annotated[
        bool, Field(description="Stop every session on this computer."), Option(flag="all")
    ] = False


@dataclass(frozen=True)
class StopOutcome:
    """Outcome of a stop command.

    Attributes:
        cell: Name of the cell to stop; None for any cell.
        results: Sessions that were asked to stop, each with its answer.
        running: Sessions that still run, if none was asked to stop.
    """

    cell: str | None
    results: Sequence[tuple[RunningSession, SessionStop]]
    running: Sequence[RunningSession]

    @property
    def exit_code(self) -> int:
        """Exit code 1 if no session was asked to stop, 4 if a session did not confirm the stop."""
        from rid_daq.terminal.exit_codes import ExitCode

        if not self.results:
            return ExitCode.VERDICT_FAILED
        confirmed = all(result.is_confirmed for _, result in self.results)
        return ExitCode.DONE if confirmed else ExitCode.COMMUNICATION

    def document(self) -> dict[str, object]:
        """Return every session with its answer to the stop."""
        return {
            "sessions": [
                {
                    "process": session.pid,
                    "command": session.command,
                    "cell": session.cell,
                    "stopped": result.is_confirmed,
                    "text": result.sentence,
                    "at_rest": result.rest_at,
                }
                for session, result in self.results
            ]
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the answer of every session, and what to do next."""
        if not self.results:
            where = "" if self.cell is None else f" on cell {self.cell}"
            text = f"No session runs{where} on this computer: nothing was stopped."
            yield Verdict(passed=False, text=text)
            for each in self.running:
                text = f"Still running: {each.words}; {_stop_advice(each)}."
                yield Verdict(passed=False, text=text)
            return
        for session, result in self.results:
            text = f"S{session.words[1:]}: {result.sentence}"
            yield Verdict(passed=result.is_confirmed, text=text)
        if self.exit_code:
            yield Text(text="Use the cell's emergency stop if anything still moves.")
            return
        yield Text(
            text="Recorded rows are kept. Remove the reason for the stop, then run `rid-daq check`"
            " before the next motion."
        )


def run(request: StopRequest, context: Context) -> StopOutcome:
    """Stop one or all sessions."""
    from rid_daq.session.running_sessions import running_sessions
    from rid_daq.session.stopping import stop_sessions

    if request.cell is not None and request.every:
        raise ConfigError(
            f"stop {request.cell} --all: give a cell or --all, not both",
            code="RID-OPTION-EXCLUSIVE",
        )
    name = None if request.cell is None else _cell_name(request.cell)
    sessions = running_sessions(name)
    if name is None and not request.every:
        sessions = _choose_sessions(sessions, context)
    results = stop_sessions(sessions)
    return StopOutcome(name, results, () if results else running_sessions())


def _cell_name(cell: str) -> str:
    """Return the cell's name from a cell file, even an invalid one; else return `cell`."""
    from config.formats.yaml_tree import MAX_BYTES

    try:
        text = read_file(Path(cell), MAX_BYTES).decode("utf-8", errors="replace")
    except OSError:
        return cell
    named = _NAME.search(text)
    return cell if named is None else named[1]


def _stop_advice(session: RunningSession) -> str:
    return f"`rid-daq stop {session.cell}` stops it" if session.cell else "its cell is unknown"


def _choose_sessions(sessions: list[RunningSession], context: Context) -> list[RunningSession]:
    """Return all sessions if fewer than two can be stopped; otherwise those that a person chooses.

    Raises:
        ConfigError: Several sessions run and no user can be asked, or another key was pressed.
    """
    several = [session for session in sessions if session.refusal is None]
    if len(several) < 2:
        return sessions
    listed = several[:MOST_LISTED]
    if not (context.is_terminal and context.can_ask):
        listing = "\n".join(f"  {session.words}; {_stop_advice(session)}" for session in several)
        raise ConfigError(
            f"{len(several)} sessions run, and none was stopped. Name the cell, or give --all:\n"
            f"{listing}",
            code="RID-STOP-WHICH",
        )
    context.say("Several sessions run. Press the number of the session to stop:")
    for number, session in enumerate(listed, 1):
        context.say(f"  {number}  {session.words}")
    context.say("  0  all sessions")
    from rid_daq.terminal.pressed_key import read_key

    key = read_key()
    if key == "0":
        return sessions
    if key.isascii() and key.isdigit() and int(key) <= len(listed):
        return [listed[int(key) - 1]]
    raise ConfigError(
        f"{key!r} is not one of the listed numbers: no session was stopped", code="RID-STOP-WHICH"
    )


OPERATION: Final = Operation(
    name="stop",
    label="Quick stop",
    request=StopRequest,
    run=run,
    examples=("stop ir361", "stop --all"),
    is_of_cells=True,
)
