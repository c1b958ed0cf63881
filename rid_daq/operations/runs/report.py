"""`report`: write a run's report again from its result."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from rid_daq.blocks.block import AnyBlock, Text, Verdict
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import DEFAULT_RUNS, RunName, RunsFolder
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.report.result import Result


class ReportRequest(Request):
    """Write a run's report again from its result.json, and print the report's path."""

    run: RunName
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class ReportResult:
    """A report that was written.

    Attributes:
        result: The result of the run.
    """

    result: Result
    report: Path

    def document(self) -> dict[str, object]:
        """Return the result of the run and the report's path."""
        return {**self.result.model_dump(mode="json", by_alias=True), "report": str(self.report)}

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the verdict and the report's path."""
        verdict = self.result.verdict
        yield Verdict(passed=verdict.passed, text=verdict.headline)
        yield Text(text=verdict.sentence)
        yield Text(text=f"Report: {self.report}", is_for_terminal=True)


def run(request: ReportRequest, _context: Context) -> ReportResult:
    """Write the report of a run."""
    from acquisition.runs.catalogue import find_run
    from rid_daq.report.result_file import read_result
    from rid_daq.report_page.write import write_result

    folder = find_run(request.runs, request.run)
    result = read_result(folder)
    return ReportResult(result, write_result(folder, result))


OPERATION: Final = Operation(
    name="report",
    label="Write a report again",
    request=ReportRequest,
    run=run,
    examples=("report latest", "report excitation --json"),
)
