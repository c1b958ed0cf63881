"""`average`: cut a periodic run into periods, reject bad periods, average the others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from rid_daq.blocks.block import AnyBlock, Text, note_blocks
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import DEFAULT_RUNS, RunName, RunsFolder, Unfinished
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.report.sections.average import AverageSection


class AverageRequest(Request):
    """Cut a periodic run into periods, reject bad periods with a reason, and average the others.

    The measurement noise is estimated from the scatter between the periods. The exit code is 6 if
    fewer than two periods are good, more than five are bad, or too many rows are lost.
    """

    run: RunName
    unfinished: Unfinished = False
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class AverageResult:
    """Averaged periods of a run.

    Attributes:
        run_id: Id of the run.
        section: Periods and their noise, as a section of the report.
        notes: Defects of the run's data.
        report: Path of the run's report.
    """

    run_id: str
    section: AverageSection
    notes: list[str]
    report: Path

    def document(self) -> dict[str, object]:
        """Return periods and noise as numbers."""
        return {
            "run": self.run_id,
            "average": self.section,
            "notes": self.notes,
            "report": str(self.report),
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the notes, the periods with their noise, and the report's path."""
        from rid_daq.report.section_blocks.average import average_blocks

        yield from note_blocks(self.notes)
        yield from average_blocks(self.section)
        yield Text(text=f"Report: {self.report}", is_for_terminal=True)


def run(request: AverageRequest, _context: Context) -> AverageResult:
    """Average the periods, and write the run's report."""
    from acquisition.runs.catalogue import find_run
    from rid_daq.report.sections.average import AverageSection
    from rid_daq.report_page.write import write_result
    from rid_daq.runs.run_data import RunData, all_defects, result_of

    data = RunData.load(find_run(request.runs, request.run), unfinished=request.unfinished)
    notes = all_defects([data])
    section = AverageSection.of(data.average, data.robot)
    report = write_result(data.folder, result_of(data, notes).with_sections(average=section))
    return AverageResult(data.folder.run_id, section, notes, report)


OPERATION: Final = Operation(
    name="average",
    label="Average the periods of a run",
    request=AverageRequest,
    run=run,
    examples=("average latest --json", "average excitation --unfinished"),
    module="rid_daq.report_page.write",
)
