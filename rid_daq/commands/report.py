"""`rid-daq report`: write a run's report again from its results."""

from __future__ import annotations

from typing import Annotated

import typer

from acquisition.run_list import find_run
from rid_daq.console import AsJson, Console
from rid_daq.result import read_result, write_result
from rid_daq.session import DEFAULT_RUNS, RunsFolder


def report(
    run: Annotated[
        str, typer.Argument(metavar="RUN", help="A run folder, its id or label, or `latest`.")
    ],
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Write a run's report again from its result.json, and say where it is."""
    console = Console(as_json)
    folder = find_run(runs, run)
    result = read_result(folder)
    path = write_result(folder, result)
    console.document(result | {"report": str(path)})
    console.verdict(result["verdict"]["passed"], result["verdict"]["headline"])
    console.say(result["verdict"]["sentence"])
    console.say(f"Report: {path}")
