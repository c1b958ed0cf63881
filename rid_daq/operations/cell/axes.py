"""`axes`: the axis test, before the first motion of a cell."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from rid_daq.blocks.block import AnyBlock, Next, Verdict
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.cell_options import SIMULATED, Cleared, Practise, Simulation
from rid_daq.requests.option import DEFAULT_RUNS, CellName, Option, RunsFolder
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.cell.axis_bench import AxesTested


class AxesRequest(Request):
    """Test direction, encoder and gear of every axis before the first motion.

    One axis at a time moves by 2 degrees (5 mm) at 2 % of its speed while SPACE is held, and stops
    when it is let go. You say which way it moved and about how far; its drive says what it counted.
    A mismatch is named, with the line of the file to change (exit code 1). Axes that pass are
    signed in this account's state; on a real cell every other motion needs that, until the cell or
    the robot file changes.
    """

    cell: CellName
    joints: Annotated[
        tuple[str, ...],
        Field(description="Joint to test; all if not set."),
        Option(flag="joint", metavar="NAME"),
    ] = ()
    unattended: Annotated[
        bool,
        Field(
            description="Test a simulated cell without a person: no key is held, and the simulated"
            " robot's true positions are the answers."
        ),
        Option(group=SIMULATED),
    ] = False
    simulation: Simulation = Simulation()
    cleared: Cleared = False
    practise: Practise = False
    tester: Annotated[
        str,
        Field(description="Person who tests; the user of this process if empty."),
        Option(owned=True, hidden=True),
    ] = ""
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class AxesResult:
    """Result of an axis test.

    Attributes:
        request: What was asked for.
        tested: The verdict of each axis, and the run that was stopped.
    """

    request: AxesRequest
    tested: AxesTested

    @property
    def exit_code(self) -> int:
        """That of a run that was stopped; 1 if an axis does not do what the files say."""
        from rid_daq.terminal.exit_codes import ExitCode

        stopped = self.tested.stopped
        if stopped is not None:
            return stopped.exit_code or ExitCode.VERDICT_FAILED
        return ExitCode.DONE if self.tested.passed else ExitCode.VERDICT_FAILED

    def document(self) -> dict[str, object]:
        """Return the motion, the answers and the verdict of each axis."""
        from rid_daq.recording.recorded_run import stop_document

        tested, stopped = self.tested, self.tested.stopped
        return {
            "cell": tested.cell,
            "passed": tested.passed,
            "axes": [
                {
                    "motion": asdict(each.motion),
                    "seen": asdict(each.seen),
                    "passed": each.passed,
                    "problems": list(each.problems),
                }
                for each in tested.verdicts
            ],
            "stopped": None if stopped is None else stopped.document(),
            **({} if stopped is None else stop_document(stopped.outcome)),
            "signed": None if tested.signed is None else str(tested.signed),
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the verdict on all axes, and the next command."""
        tested = self.tested
        if tested.stopped is not None:
            words = tested.stopped.stop_sentence or "The test was ended."
            yield Verdict(passed=False, text=f"{words} The axis test is not complete.")
        elif not tested.passed:
            text = "Not every axis does what the files say: change the lines above."
            yield Verdict(passed=False, text=text)
            yield Next(words=("axes", self.request.cell))
        else:
            signed = "" if tested.signed is None else f" Signed in {tested.signed}."
            text = f"Every axis that was tested does what the files say.{signed}"
            yield Verdict(passed=True, text=text)
            yield Next(words=("check", self.request.cell))


def run(request: AxesRequest, context: Context) -> AxesResult:
    """Test the axes."""
    from rid_daq.operations.cell.axis_bench import check_axes

    return AxesResult(request, check_axes(request, context))


OPERATION: Final = Operation(
    name="axes",
    label="Axis test",
    request=AxesRequest,
    run=run,
    examples=("axes cell.yaml --joint axis1 --joint axis2", "axes ir361 --unattended --json"),
    opens_cell=True,
    moves=True,
    is_held=True,
    module="rid_daq.operations.cell.axis_bench",
)
