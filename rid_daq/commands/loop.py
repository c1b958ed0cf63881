"""`rid-daq loop`: the drives' velocity loops, out of a multisine run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.motion.motion_file import load_motion
from acquisition.runs.catalogue import find_run
from compensation.loops.cascade import advise
from compensation.loops.loop_file import write_loops
from compensation.loops.loop_measurement import measure_loops
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.load import load_bundled_or_path
from rid_daq.report.result_file import write_result
from rid_daq.report.sections.velocity_loops import VelocityLoopsSection
from rid_daq.runs.run_data import RunData, Unfinished, note_output, result_of, tell_lacks
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.output_file import Overwrite, refuse_output


def loop(
    run: Annotated[
        str, typer.Argument(metavar="RUN", help="A multisine run: folder, id, label or `latest`.")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="LOOPS",
            help="The file of loops; RUN/loops.json if not given.",
        ),
    ] = None,
    overwrite: Overwrite = False,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Measure how the drives' velocity loops answer, and fit gain and integral time.

    The run is of a motion by `rid-daq design --kind multisine`. Intervals are two standard
    deviations, from what differs between periods and between realisations. The margins are those
    of current, velocity and position loop together; the run's report draws everything.
    """
    console = Console(as_json)
    refuse_output(output, overwrite)
    data = RunData.load(find_run(runs, run), unfinished=unfinished)
    notes = tell_lacks(console, [data])
    motion = _motion(data)
    cell = load_bundled_or_path(str(data.folder.file("cell.yaml")), "cells", CellConfig)
    found = measure_loops(data.recording, motion, data.robot, cell.position_gain_per_s)
    section = VelocityLoopsSection.of(data.robot, found, advise(found.cascades))
    output = output or data.folder.file("loops.json")
    write_loops(output, found.loops, data.robot.name, data.folder.run_id)
    note_output(data.folder, output)
    report = write_result(data.folder, result_of(data, notes).updated(velocity_loops=section))
    told = {"run": data.folder.run_id, "loops": str(output), "report": str(report)}
    console.document({**told, **section.model_dump(mode="json"), "notes": notes})
    section.print(console)
    console.say(f"Report: {report}")
    console.say(f"Loops: {output}")
    console.say(
        f"Next: rid-daq compensate CELL MOTION --model MODEL --loop {output} -o FEEDFORWARD"
    )


def _motion(data: RunData) -> MultisineMotion:
    path = data.folder.file("motion.yaml")
    which = f"run {data.folder.run_id} is"
    instead = "record one by `rid-daq design --kind multisine`"
    if not path.exists():
        raise ConfigError(f"{which} a recording from elsewhere: {instead}")
    motion = load_motion(path)
    return MultisineMotion.require(motion, f"{which} of a {motion.kind} motion: {instead}")
