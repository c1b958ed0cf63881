"""`rid-daq average`: cut a run into periods, reject bad ones, average the rest."""

from __future__ import annotations

from typing import Annotated

import typer

from acquisition.runs.catalogue import find_run
from rid_daq.report.result import write_result
from rid_daq.report.sections import average_section
from rid_daq.runs.run_data import RunData, Unfinished, result_of, tell_lacks
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.console import AsJson, Console


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
    console = Console(as_json)
    data = RunData.load(find_run(runs, run), unfinished=unfinished)
    notes = tell_lacks(console, [data])
    section = average_section(data.average, data.robot)
    result = result_of(data, notes) | {"average": section}
    path = write_result(data.folder, result)
    console.document(
        {
            "run": data.folder.run_id,
            "average": section,
            "notes": notes,
            "report": str(path),
        }
    )
    console.say(section["sentence"])
    for period in section["rejected"]:
        console.say(f"  period {period['index'] + 1} rejected: {period['reason']}")
    console.table(
        ("axis", "torque noise", "position noise"),
        [
            (
                axis["joint"],
                f"{axis['torque_noise']:.4g} {axis['torque_unit']}",
                f"{axis['position_noise']:.3g} {axis['unit']}",
            )
            for axis in section["axes"]
        ],
    )
    console.say(f"Report: {path}")
