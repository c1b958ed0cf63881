"""`rid-daq compensate`: the feedforward that makes a motion accurate, from model and loops."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from acquisition.motion.limits import verify_limits
from acquisition.motion.motion_file import AnyMotion
from acquisition.runs.catalogue import find_run
from compensation.compensated_motion import compensated_motion, refuse_torque
from compensation.feedforward.file import Origin, TuningEntry, write_feedforward
from compensation.feedforward.repeated_error import repeated_error
from compensation.feedforward.tuning import tune
from compensation.loops.velocity_loop import VelocityLoop
from compensation.online.online import in_order
from config.load import load_cell
from identification.estimation.estimate import Estimate
from identification.estimation.file import read_estimate
from rid_daq.jobs.cell_files import loops_for, motion_for
from rid_daq.runs.motion_runs import MotionRun, read_motion_run, sha256_of
from rid_daq.runs.run_data import Unfinished, tell_lacks
from rid_daq.session.cells import CellName
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.output_file import Overwrite, refuse_output


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
    as_json: AsJson = False,
) -> None:
    """Compute the speeds that make the drives produce the torques that the motion takes.

    A reference run, of this or another periodic motion and with or without compensation, tunes what
    model, loops and transport delay get wrong together; it is averaged over its periods. Nothing
    moves. `rid-daq record CELL MOTION --feedforward FEEDFORWARD` runs the motion with it.
    """
    console = Console(as_json)
    refuse_output(output, overwrite)
    loaded = load_cell(cell)
    asked = motion_for(motion, loaded)
    loops = loops_for(loop, loaded)
    samples = asked.plan(loaded.robot, loaded.config.cycle_time_s)
    estimate = read_estimate(model)
    tuning, notes = None, []
    if reference is not None:
        driven = read_motion_run(find_run(runs, reference), unfinished=unfinished)
        notes = tell_lacks(console, [driven.data])
        tuning = _tuned(driven, asked, estimate, loops)
    compensated = compensated_motion(
        samples, estimate, loops, None if tuning is None else tuning.as_tuning()
    )
    verify_limits(compensated, loaded.robot)
    refuse_torque(asked, samples, estimate, loaded.robot)
    origin = Origin(model_sha256=sha256_of(model), loops_sha256=sha256_of(loop), tuning=tuning)
    write_feedforward(output, asked, compensated, origin)
    assert compensated.feedforward is not None
    more = np.abs(compensated.feedforward - compensated.velocity).max(axis=0)
    names = loaded.robot.joint_names
    console.document(
        {
            "feedforward": str(output),
            "rows": len(samples),
            "largest_correction": dict(zip(names, more.tolist(), strict=True)),
            "tuning": None if tuning is None else tuning.model_dump(mode="json"),
            "notes": notes,
        }
    )
    if tuning is not None:
        _tell(console, tuning, names)
    changes = ", ".join(f"{name} {value:.3g}" for name, value in zip(names, more, strict=True))
    console.say(f"Largest correction of the speed [rad/s or m/s]: {changes}.")
    console.next_step("record", cell, motion, "--feedforward", output)


def _tuned(
    run: MotionRun, motion: AnyMotion, estimate: Estimate, loops: Sequence[VelocityLoop]
) -> TuningEntry:
    """Return what a reference run says of scale and delay."""
    samples = run.samples()
    ordered = in_order(samples.joint_names, estimate.robot.joint_names, loops)
    measured = repeated_error(samples, [run.data.recording])
    found = tune(samples, measured, estimate, ordered, run.cell.position_gain_per_s)
    return TuningEntry.of(found, run.run_id, run.motion == motion)


def _tell(console: Console, tuning: TuningEntry, names: tuple[str, ...]) -> None:
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
