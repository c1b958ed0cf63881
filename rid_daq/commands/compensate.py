"""`rid-daq compensate`: the feedforward that makes a motion accurate, from model and loops."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from compensation.feedforward.file import TuningEntry
from rid_daq.jobs.feedforward_job import CompensateRequest, compensate_motion
from rid_daq.runs.run_data import Unfinished
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.session.cells import CellName
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.output_file import Overwrite


def compensate(
    cell: CellName,
    motion: Annotated[Path, typer.Argument(metavar="MOTION", help="A motion file.")],
    model: Annotated[Path, typer.Option(metavar="MODEL", help="A model by `identify`.")],
    loop: Annotated[Path, typer.Option(metavar="LOOPS", help="Velocity loops by `loop`.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FEEDFORWARD", help="The file to write.")
    ],
    reference: Annotated[
        str | None,
        typer.Option(
            metavar="RUN",
            help="Tune scale and delay of every axis by this run of a periodic motion.",
        ),
    ] = None,
    overwrite: Overwrite = False,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Compute the speeds that make the drives produce the torques that the motion takes.

    A reference run, of this or another periodic motion and with or without compensation, tunes what
    model, loops and transport delay get wrong together; it is averaged over its periods. Nothing
    moves. `rid-daq record CELL MOTION --feedforward FEEDFORWARD` runs the motion with it.
    """
    request = CompensateRequest(
        cell, motion, model, loop, output, runs, reference, overwrite, unfinished
    )
    here_or_there(service, JobKind.COMPENSATE, request, Console(as_json), perform)


def perform(request: CompensateRequest, console: Console) -> None:
    """Make the feedforward, and say how large it is."""
    made = compensate_motion(request)
    for note in made.notes:
        console.say(f"note: {note}")
    tuning = made.tuning
    console.document(
        {
            "feedforward": str(request.output),
            "rows": made.rows,
            "largest_correction": made.largest,
            "tuning": None if tuning is None else tuning.model_dump(mode="json"),
            "notes": made.notes,
        }
    )
    if tuning is not None:
        _print_tuning(console, tuning, tuple(made.largest))
    changes = ", ".join(f"{name} {value:.3g}" for name, value in made.largest.items())
    console.say(f"Largest correction of the speed [rad/s or m/s]: {changes}.")
    console.next_step("record", request.cell, request.motion, "--feedforward", request.output)


def _print_tuning(console: Console, tuning: TuningEntry, names: tuple[str, ...]) -> None:
    console.table(
        ("axis", "scale", "± 2σ", "applied", "delay [ms]", "± 2σ", "applied"),
        [
            (
                name,
                f"{scale:.4f}",
                f"{2.0 * scale_std:.4f}",
                f"{applied:.4f}",
                f"{1e3 * delay_s:.3f}",
                f"{2e3 * delay_std_s:.3f}",
                f"{1e3 * applied_s:.3f}",
            )
            for name, scale, scale_std, applied, delay_s, delay_std_s, applied_s in zip(
                names,
                tuning.scale,
                tuning.scale_std,
                tuning.applied_scale,
                tuning.delay_s,
                tuning.delay_std_s,
                tuning.applied_delay_s,
                strict=True,
            )
        ],
    )
    left = [name for name, used in zip(names, tuning.used, strict=True) if not used]
    if left:
        console.say(f"Not tuned, the reference run shows too little of it: {', '.join(left)}.")
