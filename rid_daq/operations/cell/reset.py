"""`reset`: reset the faults of a cell's drives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from config.errors import PreflightError, RidDaqError
from rid_daq.blocks.block import AnyBlock, Cells, Next, Verdict, table
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import CellName
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from drivers.servo.fault_reset import FaultReset


class ResetRequest(Request):
    """Reset the faults of a cell's drives after you have found and removed their causes.

    By itself, the program resets a fault only if its own test of the drive has caused it. No power
    is switched on and nothing moves; the next motion needs the whole preflight again.

    In a terminal: exit code 3 if a drive stays in fault.
    """

    cell: CellName


@dataclass(frozen=True)
class ResetResult:
    """State of each drive after its fault was reset.

    Attributes:
        request: The request.
        cell: Name of the cell.
        drives: State of each drive before and after.
    """

    request: ResetRequest
    cell: str
    drives: tuple[FaultReset, ...]

    @property
    def failure(self) -> RidDaqError | None:
        """Error if a drive stays in fault or refused the reset; otherwise None."""
        from drivers.device_text import printable

        remaining = []
        for drive in self.drives:
            if drive.is_faulty or drive.refusal:
                why = f" ({printable(drive.refusal)})" if drive.refusal else ""
                state = f"{drive.after.words}: {drive.error}{why}"
                remaining.append(f"{drive.joint} (node {drive.node_id}) is {state}")
        if not remaining:
            return None
        return PreflightError(
            f"{'; '.join(remaining)}: remove the cause first, or see the drive's manual on how to"
            " reset the fault",
            code="RID-DRIVE-FAULT",
        )

    @property
    def exit_code(self) -> int:
        """Exit code 3 if a fault remains."""
        from rid_daq.terminal.exit_codes import ExitCode

        return ExitCode.PREFLIGHT if self.failure else ExitCode.DONE

    def document(self) -> dict[str, object]:
        """Return the states before and after the reset."""
        return {
            "cell": self.cell,
            "drives": [
                {
                    "joint": drive.joint,
                    "node": drive.node_id,
                    "before": drive.before.words,
                    "error": drive.error,
                    "after": drive.after.words,
                    "refusal": drive.refusal,
                }
                for drive in self.drives
            ],
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the states before and after the reset, the verdict, and the next command."""
        yield table(
            self.drives,
            Cells("drive", lambda drive: f"{drive.joint}, node {drive.node_id}"),
            Cells("state before", lambda drive: drive.before.words),
            Cells("error code", lambda drive: drive.error),
            Cells("state after", lambda drive: drive.after.words),
            failed=lambda drive: drive.is_faulty or bool(drive.refusal),
        )
        if self.failure:
            yield Verdict(passed=False, text=f"Cell {self.cell}: a fault remains.")
            return
        count = sum(drive.was_faulty for drive in self.drives)
        what = (
            f"Reset: {count} of {len(self.drives)} drives." if count else "No drive was in fault."
        )
        yield Verdict(passed=True, text=f"{what} Nothing was switched on.")
        yield Next(words=("check", self.request.cell))


def run(request: ResetRequest, _context: Context) -> ResetResult:
    """Reset the faults."""
    from config.load import load_cell
    from drivers.cell import open_cell
    from rid_daq.session.cells import hold_reachable_cell

    loaded = load_cell(request.cell)
    with (
        hold_reachable_cell(loaded) as (reachable, _),
        open_cell(reachable, loaded.robot) as opened,
    ):
        drives = opened.axes.service.reset_faults()
    return ResetResult(request, loaded.config.name, tuple(drives))


OPERATION: Final = Operation(
    name="reset",
    label="Reset",
    request=ResetRequest,
    run=run,
    examples=("reset ir361 --json", "reset cell.yaml --service local"),
    opens_cell=True,
    module="rid_daq.session.cells",
)
