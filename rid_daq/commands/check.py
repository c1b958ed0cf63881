"""`rid-daq check`: preflight. Every device and every safety setting; any red means no motion."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from config.errors import PreflightError, RidDaqError
from config.load import load_cell
from rid_daq.preflight.check_words import say_all, say_devices
from rid_daq.preflight.preflight import CheckRequest, preflight
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.session.cells import CellName, mountable_cell
from rid_daq.session.drive_writes import new_write_log
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.clearance import Cleared, require_cleared
from rid_daq.terminal.console import AsJson, Console, as_command


def check(
    cell: CellName,
    seconds: Annotated[
        float, typer.Option(min=0.1, max=600.0, help="How long answers are counted.")
    ] = 5.0,
    cleared: Cleared = False,
    all_lines: Annotated[
        bool, typer.Option("--all", help="Show every line, not one a device and what is red.")
    ] = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Check a cell before motion: nothing moves.

    Every drive's communication is reset, every drive is configured and read back; then SYNC is sent
    for some seconds and every answer is counted and timed. Then the heartbeats are withheld once,
    each side's, to see that the other acts: without power, unless the cell file says
    trip_watchdog_with_power, which switches the drives on at rest. A force plate's amplifier is set
    as the cell file says and read back; it is not zeroed. Where the cell has a drive monitor, every
    motor's temperature and torque constant are read too. Where axes name data sheets (EDS), those
    are looked at first: no drive is asked anything where one lacks an object by its EDS, and
    nothing is written to a drive that is another than its EDS says. Exit code 3 where a line is
    red.
    """
    request = CheckRequest(cell, runs, seconds, cleared, all_lines)
    here_or_there(service, JobKind.CHECK, request, Console(as_json), perform)


def perform(request: CheckRequest, console: Console) -> None:
    """Check a cell, and say every line.

    Raises
    ------
    RidDaqError
        The cell is not ready.
    """
    loaded = load_cell(request.cell)
    if loaded.config.drive_safety.trip_watchdog_with_power:
        require_cleared(loaded.config, request.cleared, console)
    with mountable_cell(loaded, any_eds=True) as (reachable, simulated):
        write_log = (
            new_write_log(request.runs) if simulated is None else None
        )  # these drives outlive it
        lines, problem = preflight(
            loaded,
            reachable,
            request.runs,
            request.seconds,
            write_log,
            tell=lambda found: say_devices(console, found),
        )
    red = [line for line in lines if line.verdict == "red"]
    passed = not red and problem is None
    console.document(
        {
            "cell": loaded.config.name,
            "passed": passed,
            "problem": None if problem is None else str(problem),
            "drive_writes": None if write_log is None else str(write_log.path),
            "lines": [asdict(line) for line in lines],
        }
    )
    if request.all_lines:
        say_all(console, lines)
    else:
        console.say("Every line: --all.")
    if write_log is not None and write_log.path.exists():
        undo = as_command("drives", "rollback", request.cell, write_log.path)
        console.say(f"To undo what was written to the drives: {undo}")
    if passed:
        console.verdict(True, f"Cell {loaded.config.name} is ready. Nothing was moved.")
        console.say("This is no check of the emergency stop: press it once yourself, and release.")
        return
    console.verdict(False, f"Cell {loaded.config.name} is not ready: no motion.")
    failure: RidDaqError = PreflightError(
        f"cell {loaded.config.name}: red lines in the preflight: {len(red)}; the actions are named"
        " above"
    )
    if problem is not None and not (red and isinstance(problem, PreflightError)):
        failure = problem
    raise failure
