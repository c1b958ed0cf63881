"""What `rid-daq reset` does, and says of it."""

from __future__ import annotations

from dataclasses import dataclass

from config.errors import PreflightError
from config.load import load_cell
from config.ranges import Ranged
from drivers.cell import open_cell
from drivers.device_text import printable
from drivers.servo.fault_reset import FaultReset
from rid_daq.session.cells import reachable_cell
from rid_daq.terminal.console import Console


@dataclass(frozen=True)
class ResetRequest(Ranged):
    """What `rid-daq reset` was asked for: a bundled name or a cell file."""

    cell: str


def perform(request: ResetRequest, console: Console) -> None:
    """Reset the faults, and say what each drive is now.

    Raises
    ------
    PreflightError
        A fault remains.
    """
    loaded = load_cell(request.cell)
    with (
        reachable_cell(loaded) as reachable,
        open_cell(reachable, loaded.robot) as opened,
    ):
        drives = opened.axes.service.reset_faults()
    console.document(
        {
            "cell": loaded.config.name,
            "drives": [
                {
                    "joint": drive.joint,
                    "node": drive.node_id,
                    "before": drive.before.words,
                    "error": drive.error,
                    "after": drive.after.words,
                    "refusal": drive.refusal,
                }
                for drive in drives
            ],
        }
    )
    console.table(
        ("drive", "was", "its error", "is"),
        [(f"{d.joint}, node {d.node_id}", d.before.words, d.error, d.after.words) for d in drives],
        red=[d.is_faulty or bool(d.refusal) for d in drives],
    )
    stuck = [drive for drive in drives if drive.is_faulty or drive.refusal]
    if stuck:
        console.verdict(False, f"Cell {loaded.config.name}: a fault remains.")
        raise PreflightError(
            "; ".join(_sentence(drive) for drive in stuck)
            + ": remove the cause first, or see the drive's manual for how it is reset",
            code="RID-DRIVE-FAULT",
        )
    count = sum(drive.was_faulty for drive in drives)
    what = "No drive was in fault." if not count else f"Reset: {count} of {len(drives)} drives."
    console.verdict(True, f"{what} Nothing was switched on.")
    console.next_step("check", request.cell)


def _sentence(drive: FaultReset) -> str:
    why = f" ({printable(drive.refusal)})" if drive.refusal else ""
    return f"{drive.joint} (node {drive.node_id}) is {drive.after.words}: {drive.error}{why}"
