"""`check`: the preflight of a cell; do not move a cell with a red line."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final, TypedDict

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
    from rid_daq.preflight.check_line import CheckLine


class CheckRequest(Request):
    """Check a cell before motion; nothing moves.

    The communication of every drive is reset, and every drive is configured and read back. Then
    SYNC is sent for some seconds, and every answer is counted and timed. Then the heartbeats of the
    program and of the drives are interrupted once each, to check that the other side reacts.

    The heartbeat check needs drives that are switched on, at rest, in three cases: the cell file
    says trip_watchdog_with_power, a drive lacks 6007h, 605Ah or 605Eh, or a drive is watched by
    life guarding. Such a drive shows its reaction only with power on. Before power is switched on,
    a person is asked, unless the cell is simulated or its clearance was confirmed in advance.

    The amplifier of a force plate is set as in the cell file and read back; the plate is not
    zeroed. If the cell has a drive monitor, the temperature and torque constant of every motor are
    read too. If axes name EDS files, these files are checked first: if an EDS lacks a required
    object, no drive is contacted, and nothing is written to a drive that differs from its EDS.
    Positions are compared with the joints' limits and with the pose in which the last run left the
    robot.

    In a terminal: exit code 3 if a line is red, or that of an error that ended the check early.
    """

    cell: CellName
    seconds: Annotated[
        CheckS,
        Field(description="Time during which the drives' answers are counted."),
        Option(unit="s"),
    ] = 5.0
    cleared: Cleared = False
    all_lines: Annotated[
        bool,
        Field(description="Show all lines, instead of one line per device and the red lines."),
        Option(flag="all"),
    ] = False
    accept_pose: Annotated[
        bool,
        Field(
            description="Confirm that the drives' positions are right if the robot is in another"
            " pose than after the last run."
        ),
    ] = False
    runs: RunsFolder = DEFAULT_RUNS


class CheckDocument(TypedDict):
    """Lines and outcome of a preflight."""

    cell: str
    passed: bool
    problem: str | None
    files_hash: str | None
    drive_writes: str | None
    lines: list[CheckLine]


@dataclass(frozen=True)
class CheckResult:
    """Result of a preflight.

    Attributes:
        request: The request.
        checked: Lines of the preflight, and the error that ended it early, if any.
    """

    request: CheckRequest
    checked: CheckedCell

    @property
    def failure(self) -> RidDaqError | None:
        """Error if the cell is not ready; otherwise None."""
        from drivers.servo.bring_up import common_code

        checked = self.checked
        red, problem = checked.red, checked.problem
        if problem is not None and not (red and isinstance(problem, PreflightError)):
            return problem
        if not red:
            return None
        return PreflightError(
            f"cell {checked.cell}: the preflight has {len(red)} red lines; each of these lines"
            " above names its remedy",
            code=common_code(line.code for line in red),
        )

    @property
    def exit_code(self) -> int:
        """Exit code 3 if a line is red, or the exit code of the error that ended the preflight."""
        from rid_daq.terminal.exit_codes import ExitCode, exit_code_of

        return ExitCode.DONE if self.failure is None else exit_code_of(self.failure)

    def document(self) -> CheckDocument:
        """Return the lines and the outcome of the preflight."""
        checked = self.checked
        return {
            "cell": checked.cell,
            "passed": self.failure is None,
            "problem": None if checked.problem is None else str(checked.problem),
            "files_hash": checked.files_hash,
            "drive_writes": None if checked.write_log is None else str(checked.write_log),
            "lines": list(checked.lines),
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield all lines if requested, the command that undoes the writes, and the verdict."""
        from rid_daq.preflight.check_words import all_blocks
        from rid_daq.terminal.console import as_command

        checked = self.checked
        if self.request.all_lines:
            yield from all_blocks(checked.lines)
        else:
            yield Text(text="Use --all to see every line.", is_for_terminal=True)
        if checked.write_log is not None and checked.write_log.exists():
            undo = as_command("drives", "rollback", self.request.cell, checked.write_log)
            yield Text(text=f"To undo what was written to the drives: {undo}", is_for_terminal=True)
        if self.failure is not None:
            yield Verdict(passed=False, text=f"Cell {checked.cell} is not ready: do not move it.")
            return
        yield Verdict(passed=True, text=f"Cell {checked.cell} is ready. Nothing was moved.")
        yield Text(
            text="The preflight does not test the emergency stop: press it once yourself, then"
            " release it."
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
