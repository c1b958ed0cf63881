"""What the preflight has to say of the watches between drives and computer: let run out once."""

from __future__ import annotations

import math

from drivers.cell import Cell
from drivers.servo.watchdog_test import WatchTrial, try_watches
from rid_daq.preflight.check_line import CheckLine

_DRIVE = (
    "this drive went on without this computer: it must not be moved; see its manual on 1016h and"
    " 6007h, or name its node in drive_safety.allow_drive_without_watchdog"
)
_COMPUTER = "this drive's heartbeat ended and was not missed: check 1017h in the drive"


def watch_lines(opened: Cell) -> list[CheckLine]:
    """Let both watches run out once on drives at rest.

    Raises
    ------
    DriverError, PreflightError
        As of `drivers.servo.watchdog_test.try_watches`.
    """
    trials = try_watches(opened.axes, opened.clock, opened.config)
    safety = opened.config.drive_safety
    cycle_s = opened.config.cycle_time_s
    allowed = safety.allow_drive_without_watchdog
    lines = []
    for trial in trials:
        limit_s = 1e-3 * safety.master_heartbeat_timeout_ms + 2.0 * cycle_s
        lines.append(_drive_line(trial, limit_s, excused=trial.node_id in allowed))
        limit_s = 1e-3 * safety.drive_heartbeat_timeout_ms + cycle_s
        good = trial.noticed_s <= limit_s
        lines.append(
            CheckLine(
                where=f"{trial.joint}, node {trial.node_id}",
                what="its silence is noticed after",
                required=f"≤ {1e3 * limit_s:.0f} ms",
                found=_after(trial.noticed_s),
                verdict="ok" if good else "red",
                next_action="" if good else _COMPUTER,
                of_drive=True,
            )
        )
    return lines


def _drive_line(trial: WatchTrial, limit_s: float, *, excused: bool) -> CheckLine:
    good = trial.acted_s <= limit_s
    how = f", {trial.how}" if good else ""
    return CheckLine(
        where=f"{trial.joint}, node {trial.node_id}",
        what="without this computer it acts after" + (", powered" if trial.powered else ""),
        required=f"≤ {1e3 * limit_s:.0f} ms",
        found=_after(trial.acted_s) + how,
        verdict="ok" if good else ("allowed" if excused else "red"),
        next_action="" if good or excused else _DRIVE,
        of_drive=True,
    )


def _after(time_s: float) -> str:
    return "never" if math.isnan(time_s) else f"{1e3 * time_s:.0f} ms"
