"""`rid-daq refine`: the next feedforward, from what the robot missed with this one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from acquisition.motion.limits import verify_limits
from acquisition.runs.catalogue import find_runs
from compensation.compensated_motion import with_period
from compensation.feedforward.file import Origin, RefinementEntry, write_feedforward
from compensation.feedforward.refinement import Refinement, refinement
from compensation.feedforward.repeated_error import RepeatedError, repeated_error
from compensation.loops.loop_file import read_loops
from compensation.online.online import in_order
from config.errors import ConfigError, DataQualityError
from identification.estimation.file import read_estimate
from rid_daq.runs.motion_runs import MotionRun, read_motion_run, sha256_of
from rid_daq.runs.run_data import Unfinished, tell_lacks
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.output_file import Overwrite, refuse_output

GROWN = 1.2
STALLED = 0.9


def refine(
    run: Annotated[
        list[str],
        typer.Argument(metavar="RUN...", help="Run folders, ids or labels, or `latest`."),
    ],
    model: Annotated[Path, typer.Option(metavar="MODEL", help="A model by `identify`.")],
    loop: Annotated[Path, typer.Option(metavar="LOOPS", help="Velocity loops by `loop`.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FEEDFORWARD", help="The file to write.")
    ],
    overwrite: Overwrite = False,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Correct a feedforward by what the robot missed with it.

    One run of a periodic motion, or two and more of another one, all with the same feedforward.
    Record the motion with the file that this writes, and refine again. Once the remaining error is
    noise, or has stopped shrinking, it says so and the file is the one that the run had. An error
    that grows is refused.
    """
    console = Console(as_json)
    refuse_output(output, overwrite)
    driven = [read_motion_run(folder, unfinished=unfinished) for folder in find_runs(runs, run)]
    notes = tell_lacks(console, [one.data for one in driven])
    first = driven[0]
    _refuse_mixed(driven)
    samples = first.samples()
    estimate = read_estimate(model)
    names = samples.joint_names
    loops = in_order(names, estimate.robot.joint_names, read_loops(loop)[1])
    measured = repeated_error(samples, [one.data.recording for one in driven])
    origin = Origin() if first.file is None else first.file.origin
    _refuse_growth(measured, origin)
    found = refinement(samples, measured, estimate, loops, first.cell.position_gain_per_s)
    stalled = _stalled(measured, origin)
    finished = found.finished or stalled
    ahead = samples.velocity if samples.feedforward is None else samples.feedforward
    if not finished:
        more = found.correction
        if measured.periodic:
            more = with_period(samples, np.zeros_like(ahead), more)
        entry = RefinementEntry(
            runs=tuple(one.run_id for one in driven),
            rms=tuple(measured.rms.tolist()),
            over_noise=tuple(found.over_noise.tolist()),
            noise_limit=found.noise_limit,
            bound=tuple(found.bound.largest.tolist()),
            band_hz=found.bound.band_hz,
        )
        origin = origin.model_copy(
            update={
                "model_sha256": sha256_of(model),
                "loops_sha256": sha256_of(loop),
                "refinements": (*origin.refinements, entry),
            }
        )
        ahead = ahead + more
    refined = replace(samples, feedforward=ahead)
    verify_limits(refined, first.data.robot)
    write_feedforward(output, first.motion, refined, origin)
    _tell(console, output, names, measured, found, finished, stalled and not found.finished, notes)


def _refuse_mixed(driven: list[MotionRun]) -> None:
    for other in driven[1:]:
        if other.motion != driven[0].motion or other.file != driven[0].file:
            raise ConfigError(
                f"runs {driven[0].run_id} and {other.run_id} differ in motion or feedforward:"
                " refine from repetitions of one"
            )


def _refuse_growth(measured: RepeatedError, origin: Origin) -> None:
    """Refuse to go on where the last refinement has made things worse.

    Raises
    ------
    DataQualityError
        It has; the text says in which joint, and what to do.
    """
    if not origin.refinements:
        return
    before = np.array(origin.refinements[-1].rms)
    grown = measured.rms / np.maximum(before, 1e-300)
    total = float(np.sqrt(np.square(measured.rms).sum() / np.square(before).sum()))
    if total > GROWN:
        worst = int(grown.argmax())
        raise DataQualityError(
            f"the error has grown since the last refinement, most in {measured.joint_names[worst]}"
            f" ({before[worst]:.3g} to {measured.rms[worst]:.3g}): robot, payload or loops are not"
            " those of model and loops. Use the feedforward of run"
            f" {origin.refinements[-1].runs[0]}, and measure the loops again before you go on"
        )


def _stalled(measured: RepeatedError, origin: Origin) -> bool:
    """Return whether the last refinement has changed next to nothing in any joint."""
    if not origin.refinements:
        return False
    before = np.array(origin.refinements[-1].rms)
    return bool((measured.rms > STALLED * before).all())


def _tell(
    console: Console,
    output: Path,
    names: tuple[str, ...],
    measured: RepeatedError,
    found: Refinement,
    finished: bool,
    stalled: bool,
    notes: list[str],
) -> None:
    axes: list[dict[str, Any]] = [
        {"joint": name, "rms": rms, "over_noise": over, "bound": bound}
        for name, rms, over, bound in zip(
            names,
            measured.rms.tolist(),
            found.over_noise.tolist(),
            found.bound.largest.tolist(),
            strict=True,
        )
    ]
    console.document(
        {
            "feedforward": str(output),
            "finished": finished,
            "stalled": stalled,
            "repetitions": measured.repetitions,
            "noise_limit": found.noise_limit,
            "band_hz": found.bound.band_hz,
            "axes": axes,
            "notes": notes,
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
    elif finished:
        console.say("The remaining error is noise. Refined enough.")
    else:
        console.say(
            f"Up to {found.bound.band_hz:.3g} Hz an error keeps at most that share of itself each"
            " time, for loops within their intervals."
        )
        console.say(f"Next: record the motion with --feedforward {output}, and refine again")
