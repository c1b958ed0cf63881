"""`check_cell`: perform the preflight of a cell and ask a person before drives get power."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from config.errors import RidDaqError
from config.load import load_cell
from rid_daq.operations.cell.check import CheckRequest
from rid_daq.operations.operation import Context
from rid_daq.preflight.bus_check import NOT_TESTED
from rid_daq.preflight.check_line import CheckLine
from rid_daq.preflight.check_words import show_devices
from rid_daq.preflight.last_pose import PoseRule
from rid_daq.preflight.preflight import lines_before_bus, preflight
from rid_daq.session.cells import hold_reachable_cell
from rid_daq.session.drive_writes import new_write_log
from rid_daq.terminal.clearance import ask_clearance

POWER: Final = "The drives will be switched on, at rest, and their brakes will open."


@dataclass(frozen=True)
class CheckedCell:
    """Lines of a preflight.

    Attributes:
        cell: Name of the cell.
        files_hash: Hash of the files that were read.
        lines: All lines.
        problem: Error that ended the preflight early; None if it was complete.
        write_log: Log of the writes to the drives; None if the drives are simulated by this
            process.
    """

    cell: str
    files_hash: str
    lines: Sequence[CheckLine]
    problem: RidDaqError | None
    write_log: Path | None

    @property
    def red(self) -> list[CheckLine]:
        """All red lines."""
        return [line for line in self.lines if line.verdict == "red"]


def check_cell(request: CheckRequest, context: Context) -> CheckedCell:
    """Check a cell; show each device as soon as its lines are known.

    Raises:
        ConfigError, LockedError, TransportError, RecordingError: The cell cannot be opened, or a
            file of this account cannot be used.
        PreflightError: The check needs power, and no person confirmed that the cell is clear.
    """
    loaded = load_cell(request.cell)
    name = loaded.config.name
    cleared = request.cleared or loaded.config.simulated
    if loaded.config.drive_safety.trip_watchdog_with_power:
        cleared = ask_clearance(name, cleared, context, POWER)
    before = lines_before_bus(loaded, request.runs)
    show_devices(context, before)
    with hold_reachable_cell(loaded, any_eds=True) as (reachable, simulated):
        # drives that this process simulates end with it: there is nothing to undo
        write_log = new_write_log(request.runs) if simulated is None else None
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
                tell=lambda found: show_devices(context, found),
                pose=rule,
            )

        lines, problem = look(cleared=cleared)
        if context.can_ask and any(line.what == NOT_TESTED for line in lines):
            ask_clearance(name, cleared, context, POWER)
            lines, problem = look(cleared=True)
    path = None if write_log is None else write_log.path
    return CheckedCell(name, loaded.files_hash, lines, problem, path)
