"""`rid-daq refine`: the next feedforward, from what the robot missed with this one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from rid_daq.jobs.feedforward_job import Refined, RefineRequest, refine_feedforward
from rid_daq.runs.run_data import Unfinished
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.session.session import DEFAULT_RUNS, RunNames, RunsFolder
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.output_file import Overwrite


def refine(
    run: RunNames,
    model: Annotated[Path, typer.Option(metavar="MODEL", help="A model by `identify`.")],
    loop: Annotated[Path, typer.Option(metavar="LOOPS", help="Velocity loops by `loop`.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FEEDFORWARD", help="The file to write.")
    ],
    overwrite: Overwrite = False,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Correct a feedforward by what the robot missed with it.

    One run of a periodic motion, or two and more of another one, all with the same feedforward.
    Record the motion with the file that this writes, and refine again. Once the remaining error is
    noise, or has stopped shrinking, it says so and the file is the one that the run had. An error
    that grows is refused.
    """
    request = RefineRequest(run, model, loop, output, runs, overwrite, unfinished)
    here_or_there(service, JobKind.REFINE, request, Console(as_json), perform)


def perform(request: RefineRequest, console: Console) -> None:
    """Refine the feedforward, and say what is left."""
    refined = refine_feedforward(request)
    for note in refined.notes:
        console.say(f"note: {note}")
    _print(console, request.output, refined)


def _print(console: Console, output: Path, refined: Refined) -> None:
    measured, found = refined.measured, refined.found
    stalled = refined.stalled and not found.finished
    axes: list[dict[str, Any]] = [
        {"joint": name, "rms": rms, "over_noise": over, "bound": bound}
        for name, rms, over, bound in zip(
            measured.joint_names,
            measured.rms.tolist(),
            found.over_noise.tolist(),
            found.bound.largest.tolist(),
            strict=True,
        )
    ]
    console.document(
        {
            "feedforward": str(output),
            "finished": refined.finished,
            "stalled": stalled,
            "repetitions": measured.repetitions,
            "noise_limit": found.noise_limit,
            "band_hz": found.bound.band_hz,
            "axes": axes,
            "notes": refined.notes,
        }
    )
    console.table(
        ("axis", "rms error", "power over noise", "keeps at most"),
        [
            (
                axis["joint"],
                f"{1e3 * axis['rms']:.4f}e-3",
                f"{axis['over_noise']:.3g}",
                f"{axis['bound']:.1%}",
            )
            for axis in axes
        ],
    )
    if stalled:
        console.say("The error no longer shrinks: what is left does not repeat. Refined enough.")
    elif refined.finished:
        console.say("The remaining error is noise. Refined enough.")
    else:
        console.say(
            f"Up to {found.bound.band_hz:.3g} Hz an error keeps at most that share of itself each"
            " time, for loops within their intervals."
        )
        console.say(f"Next: record the motion with --feedforward {output}, and refine again")
