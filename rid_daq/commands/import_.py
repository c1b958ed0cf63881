"""`rid-daq import`: someone else's recording into run folders."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from config.errors import ConfigError
from rid_daq.terminal.console import Console
from rid_daq.terminal.options import DEFAULT_RUNS, AsJson, RunsFolder

if TYPE_CHECKING:
    from acquisition.imports.import_map import RowRange
    from rid_daq.jobs.import_job import ImportedRun


def import_(
    file: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...", help="A CSV file, and those of the same motion; or a ROS bag."
        ),
    ],
    import_map: Annotated[
        str,
        typer.Option("--map", metavar="MAP", help="What its columns are: bundled name or file."),
    ],
    rows: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FIRST-LAST",
            help="Rows (or messages) to use, counted from 1; all if not given. Each makes a run.",
        ),
    ] = None,
    label: Annotated[
        list[str] | None,
        typer.Option(help="What to call the run, one for each --rows; else the file's name."),
    ] = None,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Read someone else's recording into a run folder: CSV files, or a ROS 2 bag or MCAP file.

    Damaged rows are named, counted and left out, and so are rows that repeat the one before while
    the robot moves. Time stamps need not be uniform; if recorded velocities show that they are
    wrong, the times are rebuilt. A recording of which too much is damaged, or that its robot cannot
    have made, is refused with exit code 6.
    """
    from rid_daq.jobs.import_job import ImportRequest, import_files

    console = Console(as_json)
    request = ImportRequest(
        file=file[0],
        import_map=import_map,
        runs=runs,
        further=tuple(file[1:]),
        rows=tuple(map(_row_range, rows or ())),
        labels=tuple(label or ()),
    )
    imported = import_files(request)
    documents = [_document(run) for run in imported]
    console.document(documents[0] if len(documents) == 1 else {"runs": documents})
    for run in imported:
        for line in run.report.lines():
            console.say(line)
        console.verdict(None if run.report.findings else True, f"Imported: {run.folder.path}")
        console.say(f"Report: {run.page}")
    if not imported[0].report.static:
        console.next_step("identify", imported[0].folder.path)


def _document(run: ImportedRun) -> dict[str, object]:
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
        "clock": None if report.clock is None else ClockSection.of(report.clock),
        "static": report.static,
    }


def _row_range(text: str) -> RowRange:
    from acquisition.imports.import_map import RowRange

    found = re.fullmatch(r"(\d{1,9})-(\d{1,9})?", text)
    first = int(found[1]) if found else 0
    last = int(found[2]) if found and found[2] else None
    if found is None or first < 1 or (last is not None and last <= first):
        raise ConfigError(
            f"--rows {text}: give FIRST-LAST, such as 355-5090, or FIRST-", code="RID-OPTION-SYNTAX"
        )
    return RowRange(first=first, last=last)
