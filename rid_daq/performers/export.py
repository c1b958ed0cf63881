"""What `rid-daq export` does, and says of it."""

from __future__ import annotations

from pathlib import Path

from acquisition.runs.catalogue import file_or_run
from rid_daq.jobs.export_job import (
    ExportedModel,
    ExportedRecording,
    ExportRequest,
    export_model,
    export_recording,
)
from rid_daq.report.consistency_entry import ConsistencyEntry
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output
from rid_daq.terminal.console import Console


def perform(request: ExportRequest, console: Console) -> None:
    """Export, and say what was written."""
    refuse_output(request.output, request.overwrite, made_file.EXPORT)
    found = file_or_run(request.runs, request.what)
    if isinstance(found, Path):
        _print_model(console, request, export_model(request))
    else:
        _print_recording(console, request, export_recording(request, found, console))


def _print_model(console: Console, request: ExportRequest, exported: ExportedModel) -> None:
    console.document(
        {
            "file": str(request.output),
            "format": request.to.value,
            "robot": exported.robot,
            "parameters": "identified" if request.as_identified else "consistent",
            "sentence": exported.sentence,
            "consistency": None if exported.test is None else ConsistencyEntry.of(exported.test),
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
