"""What `rid-daq friction` does, and says of it."""

from __future__ import annotations

import typer

from rid_daq.jobs.friction_job import FrictionRequest, measure_friction
from rid_daq.terminal.console import Console
from rid_daq.terminal.exit_codes import ExitCode


def perform(request: FrictionRequest, console: Console) -> None:
    """Measure the friction, and say what it is; exit codes as the command has them."""
    found = measure_friction(request)
    for note in found.notes:
        console.say(f"note: {note}")
    console.document(
        {
            "run": found.run_id,
            "friction": found.section,
            "notes": found.notes,
            "report": str(found.report),
        }
    )
    found.section.print(console)
    console.say(f"Report: {found.report}")
    if found.section.bad_joints:
        raise typer.Exit(ExitCode.DATA_QUALITY)
