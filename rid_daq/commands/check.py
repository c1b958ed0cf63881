"""`rid-daq check`: preflight. Every device and every safety setting; any red means no motion."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from config.cell.cell import CellConfig
from config.errors import DriverError, PreflightError, RidDaqError
from config.load import LoadedCell, load_cell
from config.robot.robot import RobotDescription
from drivers.canopen.bus_load import LOAD_LIMIT
from drivers.cell import Cell, open_cell
from drivers.interfaces import DriveSetting
from drivers.servo.axes import COLLECT_FRACTION
from drivers.servo.bring_up import bus_load
from rid_daq.preflight.bus_check import bus_lines, sender_lines
from rid_daq.preflight.check_line import CheckLine
from rid_daq.preflight.computer_check import computer_lines
from rid_daq.preflight.monitor_check import monitor_lines
from rid_daq.preflight.plate_check import PlateCheck
from rid_daq.preflight.sheet_check import sheet_lines
from rid_daq.preflight.watch_check import watch_lines
from rid_daq.session.cells import CellName, reachable_cell
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.clearance import Cleared, require_cleared
from rid_daq.terminal.console import AsJson, Console

_NEXT: dict[str, str] = {
    "1018": "this is another drive than the data sheet (eds) or identity of the axis says: see that"
    " the right drive has this node id, or name the sheet of this drive and firmware; where that is"
    " known to do, identity says what the drive may answer",
    "1016": "this drive would not stop when this computer dies: set 1016h in the drive's own tool,"
    " or name its node in drive_safety.allow_drive_without_watchdog",
    "6007": "this drive would not stop when this computer dies: set 6007h in the drive's own tool,"
    " or name its node in drive_safety.allow_drive_without_watchdog",
    "605A": "choose quick_stop_option as the drive has it, or change the drive",
    "605E": "choose fault_reaction_option as the drive has it, or change the drive",
    "6065": "change drive_safety.following_error_rad, or the drive",
    "6066": "change drive_safety.following_error_timeout_ms, or the drive",
    "6072": "change drive_safety.torque_limit_fraction, or the drive",
    "6084": "change drive_safety.quick_stop_deceleration_rad_s2, or the drive",
    "6085": "change drive_safety.quick_stop_deceleration_rad_s2, or the drive",
}
_NEXT_OTHERWISE = "the drive did not take this setting: see its manual, or set it in its own tool"


def check(
    cell: CellName,
    seconds: Annotated[
        float, typer.Option(min=0.1, max=600.0, help="How long answers are counted.")
    ] = 5.0,
    cleared: Cleared = False,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Check a cell before motion: nothing moves.

    Every drive's communication is reset, every drive is configured and read back; then SYNC is sent
    for some seconds and every answer is counted and timed. Then the heartbeats are withheld once,
    each side's, to see that the other acts: without power, unless the cell file says
    trip_watchdog_with_power, which switches the drives on at rest. A force plate's amplifier is set
    as the cell file says and read back; it is not zeroed. Where the cell has a drive monitor, every
    motor's temperature and torque constant are read too. Where axes name data sheets (EDS), those
    are looked at first: no drive is asked anything where one lacks an object by its sheet, and
    nothing is written to a drive that is another than its sheet says. Exit code 3 where a line is
    red.
    """
    console = Console(as_json)
    loaded = load_cell(cell)
    if loaded.config.drive_safety.trip_watchdog_with_power:
        require_cleared(loaded.config, cleared)
    with reachable_cell(loaded, any_sheets=True) as reachable:
        lines, problem = preflight(loaded, reachable, runs, seconds)
    red = [line for line in lines if line.verdict == "red"]
    passed = not red and problem is None
    console.document(
        {
            "cell": loaded.config.name,
            "passed": passed,
            "problem": None if problem is None else str(problem),
            "lines": [asdict(line) for line in lines],
        }
    )
    _tell(console, lines)
    for line in red:
        console.say(f"RED {line.where}, {line.what}: {line.next_action}")
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


def preflight(
    loaded: LoadedCell, reachable: CellConfig, runs: Path, seconds: float
) -> tuple[list[CheckLine], RidDaqError | None]:
    """Return the lines of the preflight of a reachable cell, and what ended it early."""
    sheets = sheet_lines(loaded)
    lines = [_bus_load(loaded.config), *bus_lines(reachable), *computer_lines(runs), *sheets]
    plate = PlateCheck(reachable, loaded.amplifier_profile)
    problem = _attempt(plate.before)
    lines += monitor_lines(reachable, loaded.robot, loaded.drive_profile)
    drives: list[CheckLine] = []
    position: list[float] = []
    fit = all(line.verdict != "red" for line in sheets)
    try:
        if fit:
            drives, position = _devices(reachable, loaded.robot, seconds)
    except _Stopped as stopped:
        drives, problem = stopped.lines, stopped.error
    if fit and problem is None:
        problem = _attempt(lambda: plate.after(position))
    return [*lines, *plate.lines, *drives], problem


def _attempt(step: Callable[[], object]) -> RidDaqError | None:
    """Do one step of the plate's check; return what went wrong, so that the drives are checked."""
    try:
        step()
    except DriverError as error:
        return error
    return None


def _tell(console: Console, lines: list[CheckLine]) -> None:
    """Write the lines: what every drive has in one row, what belongs to one place in its own."""
    drives = list(dict.fromkeys(line.where for line in lines if line.of_drive))
    rows: list[tuple[str, ...]] = []
    for what in dict.fromkeys(line.what for line in lines):
        same = {line.where: line for line in lines if line.what == what}
        found = [same[drive].found if drive in same else "" for drive in drives]
        if not any(line.of_drive for line in same.values()):
            found = [", ".join(line.found for line in same.values()), *[""] * (len(drives) - 1)]
        required = " / ".join(
            dict.fromkeys(line.required for line in same.values() if line.required)
        )
        rows.append((_worst(list(same.values())), what, required, *(found or [""])))
    console.table(
        ("", "what", "required", *(drives or ["found"])),
        rows,
        red=[row[0] == "RED" for row in rows],
    )


def _worst(lines: list[CheckLine]) -> str:
    verdicts = {line.verdict for line in lines}
    words = {"red": "RED", "allowed": "allowed", "ok": "ok", "shown": "-"}
    return next(word for verdict, word in words.items() if verdict in verdicts)


class _Stopped(Exception):  # noqa: N818 - carries what was found until then
    def __init__(self, lines: list[CheckLine], error: RidDaqError) -> None:
        super().__init__(str(error))
        self.lines = lines
        self.error = error


def _bus_load(cell: CellConfig) -> CheckLine:
    load = bus_load(cell)
    return CheckLine(
        where=f"{cell.can.interface}:{cell.can.channel}",
        what="bus load",
        required=f"≤ {100.0 * LOAD_LIMIT:.0f} %",
        found=f"{100.0 * load:.1f} %",
        verdict="ok" if load <= LOAD_LIMIT else "red",
        next_action="choose a longer cycle_time_ms or a higher bit rate",
    )


def _devices(
    cell: CellConfig, robot: RobotDescription, seconds: float
) -> tuple[list[CheckLine], list[float]]:
    """Bring every drive up, read it back, and count its answers; no power.

    Return the lines, and where the joints stand [rad or m].

    Raises
    ------
    _Stopped
        A device did not go along; with the lines until then.
    """
    lines: list[CheckLine] = []
    try:
        with open_cell(cell, robot) as opened:
            try:
                opened.axes.bring_up()
            finally:
                lines = [_setting(setting) for setting in opened.axes.settings()]
            opened.axes.start()
            lines += _answers(opened, seconds)
            position = opened.axes.position.tolist()
            if not any(line.verdict == "red" for line in lines):
                lines += watch_lines(opened)
    except (DriverError, PreflightError) as error:
        raise _Stopped(lines, error) from error
    return lines, position


def _setting(setting: DriveSetting) -> CheckLine:
    action = setting.next_action or _NEXT.get(setting.object_name[:4].upper(), _NEXT_OTHERWISE)
    return CheckLine(
        where=f"{setting.joint}, node {setting.node_id}",
        what=f"{setting.object_name} {setting.name}",
        required=setting.required,
        found=setting.found,
        verdict=setting.verdict,
        next_action=action if setting.verdict == "red" else "",
        of_drive=True,
    )


def _answers(opened: Cell, seconds: float) -> list[CheckLine]:
    """Count the answers to SYNC over some seconds."""
    axes, clock = opened.axes, opened.clock
    cycle_time_s = opened.config.cycle_time_s
    cycles = max(1, round(seconds / cycle_time_s))
    missing = [0] * len(axes.joint_names)
    exchanges_s: list[float] = []
    due_s = clock.now_s()
    for _ in range(cycles):
        due_s = max(due_s + cycle_time_s, clock.now_s())
        clock.sleep_until(due_s)
        sync_s = axes.sync()
        axes.collect(sync_s + COLLECT_FRACTION * cycle_time_s)
        exchanges_s.append(clock.now_s() - sync_s)
        axes.send_heartbeat(clock.now_s())
        axes.quick_stop()  # the drives watch for set-points; this one moves nothing
        missing = [
            count + (not received)
            for count, received in zip(missing, axes.received.tolist(), strict=True)
        ]
    exchanges_s.sort()
    slow_s = exchanges_s[math.ceil(0.99 * len(exchanges_s)) - 1]
    in_time = slow_s < COLLECT_FRACTION * cycle_time_s
    events = [event.text for event in axes.take_events() if event.kind.is_fault]
    lines = [
        CheckLine(
            where=f"{axis.joint}, node {axis.node_id}",
            what=f"answers missing of {cycles}",
            required="0",
            found=str(count),
            verdict="ok" if count == 0 else "red",
            next_action="check cable, termination and the adapter's buffers",
            of_drive=True,
        )
        for axis, count in zip(opened.config.axes, missing, strict=True)
    ]
    lines += sender_lines(opened, cycles)
    lines.append(
        CheckLine(
            where="drives",
            what="from SYNC to the last answer, 99 of 100",
            required=f"< {1e3 * COLLECT_FRACTION * cycle_time_s:.1f} ms",
            found=f"{1e3 * slow_s:.2f} ms",
            verdict="ok" if in_time else "red",
            next_action="" if in_time else "look at the bus load and the adapter's latency",
        )
    )
    if axes.lost_frames:
        lines.append(
            CheckLine(
                opened.config.can.channel,
                "frames lost by this computer",
                "0",
                str(axes.lost_frames),
                "red",
                "raise net.core.rmem_max, and see what else loads this computer",
            )
        )
    if events:
        lines.append(
            CheckLine("drives", "faults", "none", "; ".join(events), "red", "see the drive")
        )
    return lines
