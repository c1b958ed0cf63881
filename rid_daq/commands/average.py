"""`rid-daq average`: cut a run into periods, reject bad ones, average the rest."""

from __future__ import annotations

from typing import Annotated

import typer

from rid_daq.terminal.console import Console
from rid_daq.terminal.options import DEFAULT_RUNS, AsJson, RunsFolder, Unfinished


def average(
    run: Annotated[
        str, typer.Argument(metavar="RUN", help="A run folder, its id or label, or `latest`.")
    ],
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Cut a periodic run into periods, reject bad ones with a reason, and average the rest.

    The scatter between periods is the measurement noise. Exit code 6 where too little is left.
    """
    from acquisition.runs.catalogue import find_run
    from rid_daq.report.sections.average import AverageSection
    from rid_daq.report.shown.average import average_blocks
    from rid_daq.report_page.write import write_result
    from rid_daq.runs.run_data import RunData, report_lacks, result_of
    from rid_daq.terminal.shown_blocks import show

    console = Console(as_json)
    data = RunData.load(find_run(runs, run), unfinished=unfinished)
    notes = report_lacks(console, [data])
    section = AverageSection.of(data.average, data.robot)
    path = write_result(data.folder, result_of(data, notes).updated(average=section))
    console.document(
        {
            "run": data.folder.run_id,
            "average": section,
            "notes": notes,
            "report": str(path),
        }
    )
    show(average_blocks(section), console)
    console.say(f"Report: {path}")
