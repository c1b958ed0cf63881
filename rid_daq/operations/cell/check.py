"""`check`: the preflight of a cell; any red line means no motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from config.errors import PreflightError, RidDaqError
from config.ranges import CheckS
from rid_daq.blocks.block import AnyBlock, Text, Verdict
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.cell_options import Cleared
from rid_daq.requests.option import DEFAULT_RUNS, CellName, Option, RunsFolder
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.cell.checked_cell import CheckedCell


class CheckRequest(Request):
    """Check a cell before motion: nothing moves.

    Every drive's communication is reset, every drive is configured and read back; then SYNC is sent
    for some seconds and every answer is counted and timed. Then the heartbeats of each side are
    withheld once, to see that the other side reacts. For that the drives are switched on, at rest,
    if the cell file says trip_watchdog_with_power, or if a drive lacks 6007h, 605Ah or 605Eh or is
    watched by life guarding: its reaction shows in no other way. A person is asked first. A force
    plate's amplifier is set as the cell file says and read back; it is not zeroed. If the cell has
    a drive monitor, every motor's temperature and torque constant are read too. If axes name EDS
    files, those are looked at first: no drive is asked anything if one lacks an object by its EDS,
    and nothing is written to a drive that differs from its EDS. Positions are compared with the
    joints' limits and with the pose in which the last run left the robot. The exit code is 3 if a
    line is red.
    """

    cell: CellName
    seconds: Annotated[
        CheckS, Field(description="Time for which answers are counted."), Option(unit="s")
    ] = 5.0
    cleared: Cleared = False
    all_lines: Annotated[
        bool,
        Field(description="Show every line, not only one a device and the red ones."),
        Option(flag="all"),
    ] = False
    accept_pose: Annotated[
        bool,
        Field(
            description="Confirm that the drives' positions are right, although the robot is not"
            " where the last run left it."
        ),
    ] = False
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class CheckResult:
    """Result of a preflight.

    Attributes:
        request: What was asked for.
        checked: Its lines, and the error that ended it early.
    """

    request: CheckRequest
    checked: CheckedCell

    @property
    def failure(self) -> RidDaqError | None:
        """An error if the cell is not ready."""
        from drivers.servo.bring_up import common_code

        checked = self.checked
        red, problem = checked.red, checked.problem
        if problem is not None and not (red and isinstance(problem, PreflightError)):
            return problem
        if not red:
            return None
        return PreflightError(
            f"cell {checked.cell}: red lines in the preflight: {len(red)}; the actions are named"
            " above",
            code=common_code(line.code for line in red),
        )

    @property
    def exit_code(self) -> int:
        """3 if a line is red; or that of the error."""
        from rid_daq.terminal.exit_codes import ExitCode, exit_code_of

        return ExitCode.DONE if self.failure is None else exit_code_of(self.failure)

    def document(self) -> dict[str, object]:
        """Return every line."""
        checked = self.checked
        return {
            "cell": checked.cell,
            "passed": self.failure is None,
            "problem": None if checked.problem is None else str(checked.problem),
            "files_hash": checked.files_hash,
            "drive_writes": None if checked.write_log is None else str(checked.write_log),
            "lines": [asdict(line) for line in checked.lines],
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield all lines if they are wanted, how to undo what was written, and the verdict."""
        from rid_daq.preflight.check_words import all_blocks
        from rid_daq.terminal.console import as_command

        checked = self.checked
        if self.request.all_lines:
            yield from all_blocks(checked.lines)
        else:
            yield Text(text="Every line: --all.")
        if checked.write_log is not None and checked.write_log.exists():
            undo = as_command("drives", "rollback", self.request.cell, checked.write_log)
            yield Text(text=f"To undo what was written to the drives: {undo}")
        if self.failure is not None:
            yield Verdict(passed=False, text=f"Cell {checked.cell} is not ready: no motion.")
            return
        yield Verdict(passed=True, text=f"Cell {checked.cell} is ready. Nothing was moved.")
        yield Text(
            text="This is no check of the emergency stop: press it once yourself, and release."
        )


def run(request: CheckRequest, context: Context) -> CheckResult:
    """Check a cell."""
    from rid_daq.operations.cell.checked_cell import check_cell

    return CheckResult(request, check_cell(request, context))


OPERATION: Final = Operation(
    name="check",
    label="Check",
    request=CheckRequest,
    run=run,
    examples=("check ir361 --all", "check cell.yaml --seconds 20 --json"),
    opens_cell=True,
    module="rid_daq.operations.cell.checked_cell",
)
