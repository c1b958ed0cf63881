"""What `rid-daq payload export` does, and says of it."""

from __future__ import annotations

from rid_daq.jobs.payload.load_data_job import PayloadExportRequest, export_payload
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output
from rid_daq.terminal.console import Console


def perform(request: PayloadExportRequest, console: Console) -> None:
    """Write the load data, and show them."""
    refuse_output(request.output, request.overwrite, made_file.LOAD_DATA)
    exported = export_payload(request)
    output, to = request.output, request.to.value
    console.document(
        {
            "file": str(output),
            "format": to,
            "robot": exported.estimate.robot.name,
            "mass_kg": exported.estimate.body.mass_kg,
            "text": exported.text,
            "notes": list(exported.notes),
        }
    )
    console.say(exported.text.rstrip("\n"))
    if exported.notes:
        console.say(f"note: {' '.join(exported.notes)}")
    console.verdict(True, f"Wrote {output}, and read it back the same")
    console.say(
        f"Next: enter it, save what the controller then holds, and compare: rid-daq payload"
        f" read-back {request.payload} SAVED --from {to}"
    )
