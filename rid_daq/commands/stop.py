"""`rid-daq stop`: quick stop of whatever session is running on this machine."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from config.formats.bounded_file import read_file
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.exit_codes import ExitCode

_NAME = re.compile(r"^name:[ \t]*[\"']?([\w.-]+)", re.MULTILINE)


def stop(
    cell: Annotated[
        str | None,
        typer.Argument(
            metavar="[CELL]",
            help="Only the session on this cell: its name or its file. Every session if not given.",
            show_default=False,
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Stop whatever session is running on this machine: a quick stop of all axes, then power off.

    It works from any terminal of the same user (root: of every user), however busy the session is,
    and the session keeps what it has recorded. Exit code 0 says that the stop was seen; 1 that no
    session runs, 4 that one did not answer. It is not an emergency stop.
    """
    from rid_daq.session.running_sessions import running_sessions
    from rid_daq.session.stopping import stop_sessions

    console = Console(as_json)
    name = None if cell is None else _cell_name(cell)
    results = stop_sessions(name)
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
            console.verdict(False, f"Still running: {session.words}; `rid-daq stop` stops it.")
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
