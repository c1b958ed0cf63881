"""`axes`: the axis test, required before the first motion of a cell."""

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
    from rid_daq.operations.cell.axis_tester import AxisTestOutcome


class AxesRequest(Request):
    """Test direction, encoder and gear of every axis before the first motion.

    While you hold the key or button, one axis moves by at most 2 degrees (5 mm) at 2 % of its speed
    limit; it stops when you release it. You answer in which direction the axis moved and about how
    far, and your answer is compared with the drive's encoder. A mismatch is reported with the line
    of the file to change. Axes that pass are recorded in the state folder of this user account,
    except those of a bundled cell. On a real cell all other motions except `jog` require this
    record, unless a request waives it. The record becomes invalid if the cell file or the robot
    file changes.

    In a terminal: exit code 1 after a mismatch; --without-axis-test waives the record.
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
            description="Test a simulated cell without a person: no key is held, and the true"
            " positions of the simulated robot serve as answers."
        ),
        Option(group=SIMULATED),
    ] = False
    simulation: Simulation = Simulation()
    cleared: Cleared = False
    practise: Practise = False
    tester: Annotated[
        str,
        Field(
            description="Name of the person who performs the test; the user of this process if"
            " empty."
        ),
        Option(owned=True, hidden=True),
    ] = ""
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class AxesResult:
    """Result of an axis test.

    Attributes:
        request: The request.
        tested: The verdict of each axis, and the run that was stopped, if any.
    """

    request: AxesRequest
    tested: AxisTestOutcome

    @property
    def exit_code(self) -> int:
        """Exit code of a stopped run; 1 if the user ended the test or an axis does not match."""
        from rid_daq.terminal.exit_codes import ExitCode

        stopped = self.tested.stopped
        if stopped is not None:
            return stopped.exit_code or ExitCode.VERDICT_FAILED
        return ExitCode.DONE if self.tested.passed else ExitCode.VERDICT_FAILED

    def document(self) -> dict[str, object]:
        """Return the motion, the person's answer and the verdict of each axis."""
        from rid_daq.recording.recorded_run import stop_document

        tested, stopped = self.tested, self.tested.stopped
        return {
            "cell": tested.cell,
            "passed": tested.passed,
            "axes": [
                {
                    "motion": asdict(each.motion),
                    "seen": asdict(each.observed),
                    "passed": each.passed,
                    "problems": list(each.problems),
                    **({"code": each.code} if each.code else {}),
                }
                for each in tested.verdicts
            ],
            "stopped": None if stopped is None else stopped.document(),
            "suspected": tested.suspected,
            **({} if stopped is None else stop_document(stopped.outcome)),
            "signed": None if tested.signed is None else str(tested.signed),
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the verdict on all axes, and the next command."""
        tested = self.tested
        if tested.stopped is not None:
            words = tested.stopped.stop_sentence or "The test was ended by the user."
            suspected = f" {tested.suspected}" if tested.suspected else ""
            yield Verdict(passed=False, text=f"{words}{suspected} The axis test is not complete.")
        elif not tested.passed:
            text = "At least one axis does not match the files: change the lines named above."
            yield Verdict(passed=False, text=text)
            yield Next(words=("axes", self.request.cell))
        else:
            signed = "" if tested.signed is None else f" Recorded in {tested.signed}."
            text = f"Every tested axis matches the files.{signed}"
            yield Verdict(passed=True, text=text)
            yield Next(words=("check", self.request.cell))


def run(request: AxesRequest, context: Context) -> AxesResult:
    """Perform the axis test."""
    from rid_daq.operations.cell.axis_tester import check_axes

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
    module="rid_daq.operations.cell.axis_tester",
)
