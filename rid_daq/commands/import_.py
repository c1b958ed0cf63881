"""`rid-daq import`: someone else's recording into a run folder."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from acquisition.csv.import_map import RowRange, load_import_map
from acquisition.csv.read import LARGEST_FILE_BYTES, import_csv, refuse_rows_beyond
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.errors import ConfigError
from config.formats.bounded_file import read_file
from config.load import to_yaml
from rid_daq.report.result_file import write_result
from rid_daq.report.sections.verdict import Verdict
from rid_daq.runs.run_data import MAP, ROBOT, SOURCE, RunData, bad_rows, result_of
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder, as_label, unfinished
from rid_daq.session.versions import software_versions
from rid_daq.terminal.console import AsJson, Console


def import_(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A CSV file.")],
    import_map: Annotated[
        str,
        typer.Option("--map", metavar="MAP", help="What its columns are: bundled name or file."),
    ],
    rows: Annotated[
        str | None,
        typer.Option(metavar="FIRST-LAST", help="Rows to use, counted from 1; all if not given."),
    ] = None,
    label: Annotated[
        str | None, typer.Option(help="What to call the run; the file's name if not given.")
    ] = None,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Read someone else's recording (CSV) into a run folder.

    Damaged rows are named, counted and left out. Time stamps need not be uniform. A file with too
    few sound rows is refused with exit code 6.
    """
    console = Console(as_json)
    columns, robot = load_import_map(import_map)
    if rows is not None:
        columns = columns.model_copy(update={"rows": _row_range(rows)})
        refuse_rows_beyond(file, columns.rows)
    recording, report = import_csv(file, columns, robot)
    folder = RunFolder.create(
        runs, label or as_label(file.stem), kind="import", software=software_versions()
    )
    with unfinished(folder):
        folder.write(SOURCE, read_file(file, LARGEST_FILE_BYTES))
        folder.write(MAP, to_yaml(columns, f"How {SOURCE} was read.").encode())
        folder.write(ROBOT, to_yaml(robot, f"Robot {robot.name} as used.").encode())
        data = RunData.of(folder, recording, robot, report)
        headline = "Imported without loss"
        if report.rows_damaged:
            headline = f"Imported; {report.rows_damaged} damaged rows left out"
        result = result_of(data).updated(
            title=f"Import of {report.file}",
            verdict=Verdict.of([], headline, "; ".join(report.lines()[:2]) + "."),
        )
        path = write_result(folder, result)
        folder.finish(RunStatus.COMPLETE, {"robot": robot.name, "rows": report.rows_used})
    console.document(
        {
            "run": folder.run_id,
            "folder": str(folder.path),
            "report": str(path),
            "rows_read": report.rows_read,
            "rows_used": report.rows_used,
            "rows_damaged": report.rows_damaged,
            "damaged": bad_rows(report),
        }
    )
    for line in report.lines():
        console.say(line)
    console.verdict(True, f"Imported: {folder.path}")
    console.say(f"Report: {path}")
    console.next_step("identify", folder.path)


def _row_range(text: str) -> RowRange:
    found = re.fullmatch(r"(\d{1,9})-(\d{1,9})?", text)
    first = int(found[1]) if found else 0
    last = int(found[2]) if found and found[2] else None
    if found is None or first < 1 or (last is not None and last <= first):
        raise ConfigError(f"--rows {text}: give FIRST-LAST, such as 355-5090, or FIRST-")
    return RowRange(first=first, last=last)
