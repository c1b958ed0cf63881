"""`rid-daq loop`: the drives' velocity loops, out of a multisine run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

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
from rid_daq.report.render import number
from rid_daq.report.result import write_result
from rid_daq.report.velocity_loop_section import velocity_loop_section
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
    section = velocity_loop_section(data.robot, found, advise(found.cascades))
    output = output or data.folder.file("loops.json")
    write_loops(output, found.loops, data.robot.name, data.folder.run_id)
    note_output(data.folder, output)
    report = write_result(data.folder, result_of(data, notes) | {"velocity_loops": section})
    console.document(
        {"run": data.folder.run_id, "loops": str(output), "report": str(report), **section}
        | {"notes": notes}
    )
    _tell(console, section)
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


def _tell(console: Console, section: dict[str, Any]) -> None:
    axes = section["axes"]
    console.table(
        ("axis", "gain", "± 2σ", "integral time [s]", "± 2σ", "delay + lag [ms]", "p", "white"),
        [
            (
                axis["joint"],
                f"{number(axis['gain'], 5)} {axis['unit']}",
                number(2.0 * axis["std"]["gain"], 2),
                number(axis["integral_time_s"], 4),
                number(2.0 * axis["std"]["integral_time_s"], 2),
                f"{1e3 * (axis['delay_s'] + axis['lag_s']):.2f}",
                f"{axis['p_value']:.2g}",
                f"{axis['whiteness']:.2g}",
            )
            for axis in axes
        ],
    )
    console.table(
        ("axis", "inertia", "velocity loop", "", "position loop", "", "largest K_v"),
        [
            (
                axis["joint"],
                f"{number(axis['inertia'], 3)} {axis['inertia_unit']}",
                *_words(axis["velocity_margins"]),
                *_words(axis["position_margins"]),
                f"{number(axis['largest_position_gain_per_s'], 3)} 1/s",
            )
            for axis in axes
        ],
    )
    for axis in axes:
        response = axis["response"]
        console.say(
            f"{axis['joint']}: {len(response['frequency_hz'])} lines from"
            f" {response['frequency_hz'][0]:.3g} to {response['frequency_hz'][-1]:.3g} Hz;"
            f" {_distortion(axis)}."
        )
        for finding in axis["findings"]:
            console.say(f"{axis['joint']}: {finding}.")
    console.say(section["advice"])


def _words(margins: dict[str, float | None]) -> tuple[str, str]:
    phase, gain = margins["phase_deg"], margins["gain_db"]
    return (
        "no crossover" if phase is None else f"{phase:.0f}° at {margins['crossover_hz']:.2g} Hz",
        "any gain" if gain is None else f"{gain:.1f} dB",
    )


def _distortion(axis: dict[str, Any]) -> str:
    response = axis["response"]
    parts = []
    for kind in ("even", "odd"):
        level, noise = response[kind]["level"], response[kind]["noise"]
        if level:
            found, floor = (_rms(values) for values in (level, noise))
            parts.append(f"{kind} {found:.2g} (noise {floor:.2g})")
    if not parts:
        return "no line was left empty, so distortion is not told"
    return f"distortion [{axis['unit']} RMS]: {', '.join(parts)}"


def _rms(values: list[float]) -> float:
    return float((sum(value**2 for value in values) / len(values)) ** 0.5)
