"""What `rid-daq export` does, and says of it."""

from __future__ import annotations

from rid_daq.jobs.export_job import (
    ExportedModel,
    ExportedRecording,
    ExportRequest,
    export_model,
    export_recording,
)
from rid_daq.terminal.console import Console
from rid_daq.terminal.output_file import refuse_output


def perform(request: ExportRequest, console: Console) -> None:
    """Export, and say what was written."""
    refuse_output(request.output, request.overwrite)
    if request.is_model:
        _print_model(console, request, export_model(request))
    else:
        _print_recording(console, request, export_recording(request, console))


def _print_model(console: Console, request: ExportRequest, exported: ExportedModel) -> None:
    console.document(
        {
            "file": str(request.output),
            "format": request.to.value,
            "robot": exported.robot,
            "parameters": "identified" if request.as_identified else "consistent",
            "sentence": exported.sentence,
        }
    )
    console.say(exported.sentence)
    console.verdict(True, f"Wrote {request.output}")


def _print_recording(console: Console, request: ExportRequest, exported: ExportedRecording) -> None:
    rows, columns = len(exported.data.recording), exported.table.columns
    console.document(
        {
            "file": str(request.output),
            "format": request.to.value,
            "run": exported.data.folder.run_id,
            "rows": rows,
            "columns": [{"name": each.name, "unit": each.unit} for each in columns],
            "damage": list(exported.data.damage),
            "notes": exported.notes,
        }
    )
    console.verdict(True, f"Wrote {request.output}: {rows} rows, {len(columns)} columns")
