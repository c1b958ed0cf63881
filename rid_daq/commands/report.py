"""`rid-daq report`: write a run's report again from its results."""

from __future__ import annotations

from typing import Annotated

import typer

from rid_daq.terminal.console import Console
from rid_daq.terminal.options import DEFAULT_RUNS, AsJson, RunsFolder


def report(
    run: Annotated[
        str, typer.Argument(metavar="RUN", help="A run folder, its id or label, or `latest`.")
    ],
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Write a run's report again from its result.json, and say where it is."""
    from acquisition.runs.catalogue import find_run
    from rid_daq.report.result_file import read_result
    from rid_daq.report_page.write import write_result

    console = Console(as_json)
    folder = find_run(runs, run)
    result = read_result(folder)
    path = write_result(folder, result)
    console.document({**result.model_dump(mode="json", by_alias=True), "report": str(path)})
    console.verdict(result.verdict.passed, result.verdict.headline)
    console.say(result.verdict.sentence)
    console.say(f"Report: {path}")
