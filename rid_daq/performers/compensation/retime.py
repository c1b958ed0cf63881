"""What `rid-daq retime` does, and says of it."""

from __future__ import annotations

from rid_daq.jobs.retime_job import RetimeRequest, retime_motion
from rid_daq.terminal.console import Console


def perform(request: RetimeRequest, console: Console) -> None:
    """Time the path, and say what it takes."""
    made = retime_motion(request)
    section = made.section
    for note in made.notes:
        console.say(f"note: {note}")
    console.document(
        {
            "motion": str(request.output),
            "report": None if request.report is None else str(request.report),
            "moving_s": section.moving_s,
            "original_s": section.original_s,
            "shorter_percent": section.shorter_percent,
            "rows": section.rows,
            "scans": section.scans,
            "off_the_path": made.timed.off,
            "joints": [joint.model_dump(mode="json") for joint in section.joints],
            "base": [base.model_dump(mode="json") for base in section.base or ()],
            "notes": made.notes,
        }
    )
    section.print(console)
    console.next_step("record", request.cell, request.output)
