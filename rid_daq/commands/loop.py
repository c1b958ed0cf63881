"""`rid-daq loop`: the drives' velocity loops, out of a multisine run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from acquisition.run_list import find_run
from compensation.frequency_response import FrequencyResponse, frequency_responses
from compensation.loop_file import write_loops
from compensation.velocity_loop import VelocityLoop, fit_velocity_loop
from config.errors import ConfigError
from config.load import load_motion
from config.motion import MultisineMotion
from rid_daq.console import AsJson, Console
from rid_daq.report.render import number
from rid_daq.run_data import read_run
from rid_daq.session import DEFAULT_RUNS, RunsFolder

SMALLEST_P = 0.001


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
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Measure how the drives' velocity loops answer, and fit gain and integral time.

    The run is of a motion by `rid-daq design --kind multisine`. Intervals are two standard
    deviations, from what differs between periods and between realisations.
    """
    console = Console(as_json)
    data = read_run(find_run(runs, run))
    motion = load_motion(data.folder.file("motion.yaml"))
    if not isinstance(motion, MultisineMotion):
        raise ConfigError(
            f"run {data.folder.run_id} is of a {motion.kind} motion: record one by"
            " `rid-daq design --kind multisine`"
        )
    responses = frequency_responses(data.recording, motion, data.robot)
    loops = [fit_velocity_loop(response) for response in responses]
    output = output or data.folder.file("loops.json")
    inside = output.resolve().parent == data.folder.path.resolve()
    write_loops(output, loops, data.robot.name, data.folder.run_id)
    if inside:
        data.folder.write(output.name, output.read_bytes())
    console.document(
        {
            "loops": str(output),
            "axes": [_entry(r, fitted) for r, fitted in zip(responses, loops, strict=True)],
        }
    )
    console.table(
        ("axis", "gain", "± 2σ", "integral time [s]", "± 2σ", "delay + lag [ms]", "p"),
        [
            (
                fitted.joint_name,
                number(fitted.gain, 5),
                number(2.0 * fitted.sigma["gain"], 2),
                number(fitted.integral_time_s, 4),
                number(2.0 * fitted.sigma["integral_time_s"], 2),
                f"{1e3 * (fitted.delay_s + fitted.lag_s):.2f}",
                f"{fitted.p_value:.2g}",
            )
            for fitted in loops
        ],
    )
    for response in responses:
        console.say(_distortion(response))
    for fitted in loops:
        if fitted.p_value < SMALLEST_P:
            console.say(
                f"{fitted.joint_name}: a proportional-integral controller does not explain what was"
                " measured: look for filters in the drive, or excite less"
            )
    console.say(f"Loops: {output}")
    console.say(
        f"Next: rid-daq compensate CELL MOTION --model MODEL --loop {output} -o FEEDFORWARD"
    )


def _entry(response: FrequencyResponse, fitted: VelocityLoop) -> dict[str, Any]:
    return {
        "joint": fitted.joint_name,
        "gain": fitted.gain,
        "integral_time_s": fitted.integral_time_s,
        "delay_s": fitted.delay_s,
        "lag_s": fitted.lag_s,
        "std": fitted.sigma,
        "p_value": fitted.p_value,
        "trials": [
            {"extras": list(trial.extras), "aic": trial.aic, "mdl": trial.mdl}
            for trial in fitted.trials
        ],
        "frequency_hz": response.frequency_hz.tolist(),
        "magnitude": abs(response.response).tolist(),
        "std_noise": (response.variance_noise**0.5).tolist(),
        "std_total": (response.variance**0.5).tolist(),
        "coherence": response.coherence.tolist(),
    }


def _distortion(response: FrequencyResponse) -> str:
    parts = [
        f"{words} {float((d.level_nm**2).mean()) ** 0.5:.3g} (noise"
        f" {float((d.noise_nm**2).mean()) ** 0.5:.2g})"
        for words, d in (("even", response.even), ("odd", response.odd))
        if len(d.level_nm)
    ]
    return (
        f"{response.joint_name}: {len(response.frequency_hz)} lines from"
        f" {response.frequency_hz[0]:.3g} to {response.frequency_hz[-1]:.3g} Hz; torque at lines"
        f" that nobody excites [N m or N RMS]: {', '.join(parts)}"
    )
