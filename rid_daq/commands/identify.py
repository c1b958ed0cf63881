"""`rid-daq identify`: estimate the robot's parameters from one or more runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acquisition.periods import average_periods
from acquisition.run_list import find_run
from identification.estimate import Estimate
from identification.estimate_file import write_estimate
from identification.estimators import BAND_HZ, STANDSTILL_RAD_S
from identification.model_options import ModelOptions
from rid_daq.console import AsJson, Console
from rid_daq.curves import period_curves
from rid_daq.identification_job import estimate_runs
from rid_daq.report.render import number
from rid_daq.result import write_result
from rid_daq.run_data import read_run, result_of
from rid_daq.sections import average_section, estimate_section
from rid_daq.session import DEFAULT_RUNS, RunsFolder

MODEL = "model.json"


def identify(
    run: Annotated[
        list[str],
        typer.Argument(metavar="RUN...", help="Run folders, ids or labels, or `latest`."),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="MODEL", help=f"The model file; RUN/{MODEL} if not given."
        ),
    ] = None,
    band_hz: Annotated[
        float, typer.Option("--band", min=0.01, help="Highest frequency used [Hz].")
    ] = BAND_HZ,
    standstill_rad_s: Annotated[
        float, typer.Option("--standstill", min=0.0, help="Lowest speed used for friction [rad/s].")
    ] = STANDSTILL_RAD_S,
    rotors: Annotated[bool, typer.Option(help="Rotors with their coupling.")] = True,
    friction: Annotated[bool, typer.Option(help="Friction as the robot file names it.")] = True,
    spring: Annotated[bool, typer.Option(help="The gravity spring.")] = True,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Estimate the robot's base parameters, with intervals, from one or more runs.

    Periodic runs are averaged and used on their harmonics; others are low-passed without phase
    shift and used in the time domain. The model file is complete in itself.
    """
    console = Console(as_json)
    data = [read_run(find_run(runs, name)) for name in run]
    options = ModelOptions(rotors=rotors, friction=friction, spring=spring)
    estimate = estimate_runs(data, options, band_hz=band_hz, standstill_rad_s=standstill_rad_s)
    first = data[0]
    if output is None:
        output = first.folder.file(MODEL)
        inside = True
    else:
        inside = False
    write_estimate(output, estimate)
    if inside:
        first.folder.write(MODEL, output.read_bytes())
    result = result_of(first)
    result["estimate"] = estimate_section(estimate)
    if first.is_periodic:
        average = average_periods(first.recording)
        result["average"] = average_section(average, first.robot)
        result["curves"] = period_curves(estimate, average)
    path = write_result(first.folder, result)
    console.document({"model": str(output), "report": str(path), "estimate": result["estimate"]})
    _tell(console, estimate, result["estimate"]["sentence"])
    console.verdict(True, f"Model: {output}")
    console.say(f"Report: {path}")
    console.say(f"Next: rid-daq validate {output} RUN, with a run that was not used here")


def _tell(console: Console, estimate: Estimate, sentence: str) -> None:
    console.say(sentence)
    console.table(
        ("#", "parameter", "estimate", "± 2σ", "unit"),
        [
            (
                str(i + 1),
                estimate.base.words[i],
                number(float(estimate.values[i]), 5),
                number(2.0 * float(estimate.sigma[i]), 2),
                estimate.base.units[i],
            )
            for i in range(len(estimate.base))
        ],
    )
    if estimate.base.unseen:
        console.say(f"Without any effect on the torques: {', '.join(estimate.base.unseen)}")
