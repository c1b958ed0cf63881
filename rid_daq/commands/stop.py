"""`rid-daq stop`: quick stop of a session that runs on this machine."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from config.errors import ConfigError
from config.formats.bounded_file import read_file
from rid_daq.terminal.console import Console
from rid_daq.terminal.exit_codes import ExitCode
from rid_daq.terminal.options import AsJson

if TYPE_CHECKING:
    from rid_daq.session.running_sessions import RunningSession

MOST_LISTED: Final = 9
_NAME = re.compile(r"^name:[ \t]*[\"']?([\w.-]+)", re.MULTILINE)


def stop(
    cell: Annotated[
        str | None,
        typer.Argument(
            metavar="[CELL]",
            help="Cell to stop: its name or its file (default: the only session that runs).",
            show_default=False,
        ),
    ] = None,
    every: Annotated[
        bool, typer.Option("--all", help="Stop every session on this computer.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Stop the session that runs on this machine: a quick stop of all axes, then power off.

    It works from any terminal of the same user (root: of every user), however busy the session is,
    and the session keeps what it has recorded. If several sessions run, name the cell, or choose
    from the list; without a terminal none is stopped then, and the exit code is 2. Exit code 0
    says that the stop was seen; 1 that no session runs, 4 that one did not answer. It is not an
    emergency stop.
    """
    from rid_daq.session.running_sessions import running_sessions
    from rid_daq.session.stopping import stop_sessions

    console = Console(as_json)
    if cell is not None and every:
        raise ConfigError(f"stop {cell} --all: give a cell or --all, not both", code="RID-STOP-ALL")
    name = None if cell is None else _cell_name(cell)
    sessions = running_sessions(name)
    if name is None and not every:
        sessions = _chosen(sessions, console)
    results = stop_sessions(sessions)
    console.document(
        {
            "sessions": [
                {
                    "process": session.pid,
                    "command": session.command,
                    "cell": session.cell,
                    "stopped": result.seen,
                    "text": result.sentence,
                    "at_rest": result.rest_at,
                }
                for session, result in results
            ]
        }
    )
    if not results:
        where = "" if name is None else f" on cell {name}"
        console.verdict(False, f"No session runs{where} on this machine: nothing was stopped.")
        for session in running_sessions():
            console.verdict(False, f"Still running: {session.words}; {_advice(session)}.")
        raise typer.Exit(ExitCode.VERDICT_FAILED)
    for session, result in results:
        console.verdict(result.seen, f"S{session.words[1:]}: {result.sentence}")
    if not all(result.seen for _, result in results):
        console.say("Use the cell's emergency stop where anything still moves.")
        raise typer.Exit(ExitCode.COMMUNICATION)
    console.say(
        "What was recorded is kept. Find out why it had to stop. Then check the cell before the"
        " next motion."
    )


def _cell_name(cell: str) -> str:
    """Return the name in a cell file, whatever else is wrong there, or what was given."""
    from config.formats.yaml_tree import MAX_BYTES

    try:
        text = read_file(Path(cell), MAX_BYTES).decode("utf-8", errors="replace")
    except OSError:
        return cell
    named = _NAME.search(text)
    return cell if named is None else named[1]


def _advice(session: RunningSession) -> str:
    return f"`rid-daq stop {session.cell}` stops it" if session.cell else "its cell is not known"


def _chosen(sessions: list[RunningSession], console: Console) -> list[RunningSession]:
    """Return the only session that can be stopped, or the one that a person chooses.

    Raises
    ------
    ConfigError
        Several run and nobody can be asked, or none of them was chosen.
    """
    several = [session for session in sessions if session.refusal is None]
    if len(several) < 2:
        return sessions
    listed = several[:MOST_LISTED]
    if not (console.is_terminal and console.can_ask):
        listing = "\n".join(f"  {session.words}; {_advice(session)}" for session in several)
        raise ConfigError(
            f"{len(several)} sessions run, and none was stopped. Name the cell, or give --all:\n"
            f"{listing}",
            code="RID-STOP-WHICH",
        )
    console.say("Several sessions run. Press the number of the one to stop:")
    for number, session in enumerate(listed, 1):
        console.say(f"  {number}  {session.words}")
    console.say("  0  all of them")
    from rid_daq.terminal.pressed_key import read_key

    key = read_key()
    if key == "0":
        return sessions
    if key.isascii() and key.isdigit() and int(key) <= len(listed):
        return [listed[int(key) - 1]]
    raise ConfigError(
        f"{key!r} is none of the numbers: no session was stopped", code="RID-STOP-WHICH"
    )
