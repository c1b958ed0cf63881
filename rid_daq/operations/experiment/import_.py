"""`import`: import a recording of another program as run folders."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import AfterValidator, Field

from rid_daq.blocks.block import AnyBlock, Next, Text, Verdict
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import DEFAULT_RUNS, FILES, Option, RunsFolder
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.experiment.imported_runs import ImportedRun
    from rid_daq.operations.experiment.map_proposal import MapProposal


def first_and_last(rows: str) -> tuple[int, int | None]:
    """Return the first and last number of a range of rows; the last is None if omitted.

    Args:
        rows: Text such as 355-5090, or 355-.

    Raises:
        ValueError: The text is not a range.
    """
    found = re.fullmatch(r"([1-9]\d{0,8})-(\d{1,9})?", rows)
    first, last = map(int, found.groups("0")) if found else (0, 0)
    if found is None or (found[2] and last <= first):
        raise ValueError("must be FIRST-LAST, such as 355-5090, or FIRST-")
    return first, last or None


def _check_rows(rows: str) -> str:
    first_and_last(rows)
    return rows


class ImportRequest(Request):
    """Import a recording of another program as a run folder.

    The recording is one or more CSV, MAT, NPZ, HDF5 or Parquet files, a ROS bag or an MCAP file.
    Damaged rows are listed, counted and left out; so are rows that repeat the previous row while
    the robot moves. Time stamps need not be uniform. If recorded velocities show that the time
    stamps are wrong, the times are reconstructed. The import is refused if too much of a recording
    is damaged, or if its values are impossible for the named robot.

    Without --map, --robot ROBOT proposes a map for the file and writes it, with the reasons. Check
    the map, then import with it.

    In a terminal: exit code 6 if the import is refused for these reasons.
    """

    file: Annotated[
        tuple[Path, ...],
        Field(
            min_length=1,
            description="Files of one motion (CSV, MAT, NPZ, HDF5 or Parquet), or one ROS bag.",
        ),
        Option(positional=True, metavar="FILE...", file="input"),
    ]
    map: Annotated[
        str | None,
        Field(
            description="Import map that describes the columns or arrays: a bundled name or a file."
        ),
        Option(metavar="MAP", file="input"),
    ] = None
    robot: Annotated[
        str | None,
        Field(
            description="Robot that moved: a bundled name or a robot file. Without --map: write a"
            " proposed map instead of importing."
        ),
        Option(metavar="ROBOT", file="input"),
    ] = None
    proposal: Annotated[
        Path | None,
        Field(
            description="File for the proposed map. If not set: the recording's name with the"
            " ending .map.yaml."
        ),
        Option(metavar="FILE", group=FILES, file="output", endings=(".yaml",), needs="robot"),
    ] = None
    rows: Annotated[
        tuple[Annotated[str, AfterValidator(_check_rows)], ...],
        Field(
            description="Rows (or messages) to use, counted from 1; all if not set. Each range"
            " becomes a run."
        ),
        Option(metavar="FIRST-LAST"),
    ] = ()
    label: Annotated[
        tuple[str, ...],
        Field(
            description="Label of the run, one for each range of rows. If not set: the file's name,"
            " with the range if there are several."
        ),
        Option(group=FILES),
    ] = ()
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class ImportResult:
    """Runs that were made from a recording.

    Attributes:
        runs: One run for each range of rows.
    """

    runs: tuple[ImportedRun, ...]

    def document(self) -> Mapping[str, object]:
        """Return the import report of one run, or a list of reports of several runs."""
        documents = [_run_document(each) for each in self.runs]
        return documents[0] if len(documents) == 1 else {"runs": documents}

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the import report, folder and page of each run, and the next command if any."""
        for each in self.runs:
            for line in each.report.lines():
                yield Text(text=line)
            passed = None if each.report.findings else True
            yield Verdict(passed=passed, text=f"Imported: {each.folder.path}")
            yield Text(text=f"Report: {each.page}", is_for_terminal=True)
        if not self.runs[0].report.static:
            yield Next(words=("identify", str(self.runs[0].folder.path)))


def _run_document(run: ImportedRun) -> dict[str, object]:
    from rid_daq.report.sections.runs import BadRows, ClockSection

    report = run.report
    return {
        "run": run.folder.run_id,
        "folder": str(run.folder.path),
        "report": str(run.page),
        "rows_read": report.rows_read,
        "rows_used": report.rows_used,
        "rows_damaged": report.rows_damaged,
        "left_out": report.left_out,
        "damaged": BadRows.of(report),
        "findings": report.findings,
        "velocity_ratio": report.velocity_ratio,
        "refined_step": report.refined_step,
        "rounded_step": report.rounded_step,
        "clock": None if report.clock is None else ClockSection.of(report.clock),
        "static": report.static,
        "plate": None if report.plate is None else asdict(report.plate),
    }


def run(request: ImportRequest, context: Context) -> ImportResult | MapProposal:
    """Import the files, or propose a map for them."""
    from rid_daq.operations.experiment.imported_runs import import_files
    from rid_daq.operations.experiment.map_proposal import write_proposal

    if request.map is None:
        return write_proposal(request)
    return ImportResult(import_files(request, context))


OPERATION: Final = Operation(
    name="import",
    label="Import a recording",
    request=ImportRequest,
    run=run,
    examples=(
        "import recording.csv --map map.yaml",
        "import recording.csv --robot robot.yaml",
        "import bag.mcap --map ur10_ros --rows 1-4000 --rows 4001- --label first --label second",
    ),
    module="rid_daq.operations.experiment.imported_runs",
)
