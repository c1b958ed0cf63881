"""`plate zero`: measure the offsets of the force plate under the robot."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final, TypedDict

from pydantic import Field

from config.ranges import PositionRad, ReadingS, SettleS
from rid_daq.blocks.block import AnyBlock, Text, Verdict
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.cell_options import AxisTest, Cleared, Practise, Simulation
from rid_daq.requests.option import DEFAULT_RUNS, FILES, CellName, Option, RunsFolder
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.cell.zeroed_plate import ZeroedPlate
    from rid_daq.report.sections.verdict import VerdictSection


class PlateZeroRequest(Request):
    """Measure the force plate's offsets by half a turn of axis 1.

    The robot moves. The plate is read, axis 1 turns by half a turn, the plate is read, axis 1 turns
    back, and the plate is read again. The amplifier is reset while the robot rests in the first
    pose, and operates from then on. After half a turn, half the sum of the first two readings is
    the offset, half their difference the moment of gravity; the third reading shows the drift. If
    the limits of axis 1 do not allow half a turn, it turns as far as they allow, and the offset is
    less accurate. The lines for the cell file are printed.

    In a terminal: exit code 1 if the zero fails its check.
    """

    cell: CellName
    pose: Annotated[
        tuple[PositionRad, ...] | None,
        Field(
            description="Pose in the middle of axis 1's turn, one value per joint; the middle of"
            " each joint's range if not set."
        ),
        Option(unit="rad or m", metavar="RAD,...", separator=","),
    ] = None
    read_s: Annotated[
        ReadingS, Field(description="Duration of each reading."), Option(flag="read", unit="s")
    ] = 5.0
    settle_s: Annotated[
        SettleS,
        Field(description="Waiting time at rest before each reading."),
        Option(flag="settle", unit="s"),
    ] = 2.0
    write: Annotated[
        bool,
        Field(
            description="Write a zero that passes its check into the cell file; its other lines"
            " stay unchanged."
        ),
    ] = False
    simulation: Simulation = Simulation()
    cleared: Cleared = False
    axis_test: AxisTest = "required"
    practise: Practise = False
    label: Annotated[str, Field(description="Name of the run."), Option(group=FILES)] = "plate zero"
    runs: RunsFolder = DEFAULT_RUNS


class PlateZeroDocument(TypedDict):
    """A measured zero of the plate."""

    folder: str
    report: str
    zero: dict[str, object]
    plate_zero: object
    verdict: VerdictSection
    written: str | None


@dataclass(frozen=True)
class PlateZeroResult:
    """Offsets of a force plate.

    Attributes:
        zeroed: The run, and the offsets; if the motion was stopped, only the run.
    """

    zeroed: ZeroedPlate

    @property
    def exit_code(self) -> int:
        """Exit code of a run that was stopped; otherwise 1 if the zero failed its check."""
        from rid_daq.terminal.exit_codes import ExitCode

        run = self.zeroed.run
        if self.zeroed.zero is None:
            return run.exit_code
        return ExitCode.DONE if run.result.verdict.passed else ExitCode.VERDICT_FAILED

    def document(self) -> PlateZeroDocument | dict[str, object]:
        """Return the zero; if the motion was stopped, return the stop reason."""
        from rid_daq.recording.recorded_run import stop_document

        zeroed, run = self.zeroed, self.zeroed.run
        if zeroed.zero is None:
            kept = {} if zeroed.approach_only else {"folder": str(run.folder.path)}
            return kept | stop_document(run.outcome)
        return {
            "folder": str(run.folder.path),
            "report": str(run.report),
            "zero": zeroed.zero.model_dump(mode="json"),
            "plate_zero": run.result.plate_zero,
            "verdict": run.result.verdict,
            "written": None if zeroed.written is None else str(zeroed.written),
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield offsets and drift, the verdict, and the lines for the cell file."""
        from rid_daq.report.section_blocks.plate import plate_zero_blocks

        zeroed, run = self.zeroed, self.zeroed.run
        if zeroed.zero is None:
            yield Verdict(passed=False, text=run.stop_sentence)
            if not zeroed.approach_only:
                yield Text(
                    text="The plate is not zeroed: repeat `plate zero`, because `record` would"
                    " subtract wrong offsets."
                )
                yield Text(text=f"Report: {run.report}", is_for_terminal=True)
            return
        section, verdict = run.result.plate_zero, run.result.verdict
        assert section is not None
        yield from plate_zero_blocks(section)
        yield Verdict(passed=verdict.passed, text=f"{verdict.headline}. {verdict.sentence}")
        yield Text(text=f"Report: {run.report}", is_for_terminal=True)
        if zeroed.written is not None:
            yield Text(text=f"4 of 4: the zero was written into {zeroed.written}")
        elif verdict.passed:
            yield Text(
                text="4 of 4: add these lines under `plate:` in the cell file (--write does it"
                " for you):",
                is_for_terminal=True,
            )
            yield Text(text=zeroed.lines.rstrip("\n"), is_for_terminal=True)


def run(request: PlateZeroRequest, context: Context) -> PlateZeroResult:
    """Zero the force plate."""
    from rid_daq.operations.cell.zeroed_plate import zero_plate

    return PlateZeroResult(zero_plate(request, context))


OPERATION: Final = Operation(
    name="plate zero",
    label="Zero the plate",
    request=PlateZeroRequest,
    run=run,
    examples=(
        "plate zero ir361 --read 10",
        "plate zero cell.yaml --pose 0,0.2,-0.4 --write",
    ),
    opens_cell=True,
    moves=True,
    module="rid_daq.operations.cell.zeroed_plate",
)
