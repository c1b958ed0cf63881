"""What `rid-daq refine` does, and says of it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from rid_daq.jobs.feedforward_job import Refined, RefineRequest, refine_feedforward
from rid_daq.terminal.console import Console


class _Axis(NamedTuple):
    """What is left of an axis's error."""

    joint: str
    rms: float
    over_noise: float
    bound: float


def perform(request: RefineRequest, console: Console) -> None:
    """Refine the feedforward, and say what is left."""
    refined = refine_feedforward(request)
    for note in refined.notes:
        console.say(f"note: {note}")
    _print(console, request.output, refined)


def _print(console: Console, output: Path, refined: Refined) -> None:
    measured, found = refined.measured, refined.found
    stalled = refined.stalled and not found.finished
    axes = [
        _Axis(*told)
        for told in zip(
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
            "axes": [axis._asdict() for axis in axes],
            "notes": refined.notes,
        }
    )
    console.table(
        ("axis", "rms error [mrad or mm]", "power over noise", "keeps at most"),
        [
            (
                axis.joint,
                f"{1e3 * axis.rms:.4f}",
                f"{axis.over_noise:.0f}" if axis.over_noise >= 100.0 else f"{axis.over_noise:.3g}",
                f"{100.0 * axis.bound:.1f} %",
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
            " time, for loops within their intervals. Where joints reverse, friction may leave"
            " more."
        )
        console.next_step("record", refined.cell, refined.motion, "--feedforward", output)
        console.say("Then refine again, by that run.")
