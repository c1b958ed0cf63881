"""What `rid-daq loop` does, and says of it."""

from __future__ import annotations

import typer

from rid_daq.jobs.loop_job import LoopRequest, measure_velocity_loops
from rid_daq.terminal.console import Console, as_command
from rid_daq.terminal.exit_codes import ExitCode


def perform(request: LoopRequest, console: Console) -> None:
    """Measure the loops, and say what they are; exit codes as the command has them."""
    found = measure_velocity_loops(request)
    for note in found.notes:
        console.say(f"note: {note}")
    told = {"run": found.run_id, "loops": str(found.output), "report": str(found.report)}
    console.document({**told, **found.section.model_dump(mode="json"), "notes": found.notes})
    found.section.print(console)
    console.say(f"Report: {found.report}")
    console.say(f"Loops: {found.output}")
    if found.section.bad_joints:
        raise typer.Exit(ExitCode.DATA_QUALITY)
    console.say("Next, for a motion file MOTION and the robot's MODEL by `identify`:")
    words = ("--model", "MODEL", "--loop", found.output, "-o", "FEEDFORWARD")
    console.say(f"  {as_command('compensate', found.cell, 'MOTION', *words)}")
