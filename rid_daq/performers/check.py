"""What `rid-daq check` does, and says of it."""

from __future__ import annotations

from dataclasses import asdict

from config.errors import PreflightError, RidDaqError
from config.load import load_cell
from rid_daq.preflight.check_words import say_all, say_devices
from rid_daq.preflight.preflight import CheckRequest, lines_before_bus, preflight
from rid_daq.session.cells import mountable_cell
from rid_daq.session.drive_writes import new_write_log
from rid_daq.terminal.clearance import require_cleared
from rid_daq.terminal.console import Console, as_command


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
    told = lines_before_bus(loaded, request.runs)
    say_devices(console, told)
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
            told=told,
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
