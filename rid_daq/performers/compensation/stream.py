"""What `rid-daq stream` does, and says of it."""

from __future__ import annotations

from rid_daq.recording.stream_job import StreamRequest, stream_path
from rid_daq.terminal.console import Console


def perform(request: StreamRequest, console: Console) -> None:
    """Stream, and say what became of it; exit codes as the command has them."""
    run = stream_path(request, console)
    console.document(run.document() | {"compensated": request.options.compensated})
    console.say(run.timing_sentence)
    if run.print_verdict(console) and request.motion is not None:
        console.next_step("tracking", run.folder.path)
    if run.exit_code:
        raise SystemExit(run.exit_code)
