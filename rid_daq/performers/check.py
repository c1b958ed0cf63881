"""What `rid-daq check` does, and says of it."""

from __future__ import annotations

from dataclasses import asdict

from config.errors import PreflightError, RidDaqError
from config.load import load_cell
from drivers.servo.bring_up import common_code
from rid_daq.preflight.bus_check import TRIAL_WAITS, CheckLine
from rid_daq.preflight.check_words import say_all, say_devices
from rid_daq.preflight.last_pose import PoseRule
from rid_daq.preflight.preflight import CheckRequest, lines_before_bus, preflight
from rid_daq.session.cells import mountable_cell
from rid_daq.session.drive_writes import new_write_log
from rid_daq.terminal.clearance import clear
from rid_daq.terminal.console import Console, as_command

POWER = "The drives will be switched on, at rest, and their brakes open."


def perform(request: CheckRequest, console: Console) -> None:
    """Check a cell, and say every line.

    Raises
    ------
    RidDaqError
        The cell is not ready.
    """
    loaded = load_cell(request.cell)
    cleared = request.cleared or loaded.config.simulated
    if loaded.config.drive_safety.trip_watchdog_with_power and not cleared:
        cleared = clear(loaded.config.name, cleared, console, POWER)
    before = lines_before_bus(loaded, request.runs)
    say_devices(console, before)
    with mountable_cell(loaded, any_eds=True) as (reachable, simulated):
        write_log = (
            new_write_log(request.runs) if simulated is None else None
        )  # these drives outlive it

        rule = PoseRule.ACCEPTED if request.accept_pose else PoseRule.COMPARED
        if simulated is not None:
            rule = PoseRule.LEFT_OUT

        def look(*, cleared: bool) -> tuple[list[CheckLine], RidDaqError | None]:
            return preflight(
                loaded,
                reachable,
                before,
                request.seconds,
                cleared=cleared,
                write_log=write_log,
                tell=lambda found: say_devices(console, found),
                pose=rule,
            )

        lines, problem = look(cleared=cleared)
        if console.can_ask and any(line.what == TRIAL_WAITS for line in lines):
            clear(loaded.config.name, cleared, console, POWER)
            lines, problem = look(cleared=True)
    red = [line for line in lines if line.verdict == "red"]
    passed = not red and problem is None
    console.document(
        {
            "cell": loaded.config.name,
            "passed": passed,
            "problem": None if problem is None else str(problem),
            "files_hash": loaded.files_hash,
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
        " above",
        code=common_code(line.code for line in red),
    )
    if problem is not None and not (red and isinstance(problem, PreflightError)):
        failure = problem
    raise failure
