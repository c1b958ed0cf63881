"""What `rid-daq compensate` does, and says of it."""

from __future__ import annotations

from compensation.feedforward.file import TuningEntry
from rid_daq.blocks.formats import measured
from rid_daq.jobs.feedforward_job import CompensateRequest, compensate_motion
from rid_daq.terminal.console import Console


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
    console.say(
        "What the reference run shows of the feedforward's scale and delay; 1 and 0 are applied"
        " where it cannot tell the value from them:"
    )
    console.table(
        ("axis", "scale", "± 2σ", "applied", "delay [ms]", "± 2σ", "applied"),
        [
            (
                name,
                *measured(scale, 2.0 * scale_std),
                f"{applied:.4f}",
                *measured(1e3 * delay_s, 2e3 * delay_std_s),
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
