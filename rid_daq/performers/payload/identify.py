"""What `rid-daq payload identify` does, and says of it."""

from __future__ import annotations

from rid_daq.jobs.payload.identify_job import PayloadIdentifyRequest, identify_payload_runs
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output
from rid_daq.terminal.console import Console
from rid_daq.terminal.exit_codes import ExitCode


def perform(request: PayloadIdentifyRequest, console: Console) -> None:
    """Identify a payload, and say the verdict; exit codes as the command has them."""
    refuse_output(request.output, request.overwrite, made_file.PAYLOAD)
    identified = identify_payload_runs(request, console)
    section, verdict, file = identified.section, identified.verdict, identified.file
    console.document(
        {
            "file": str(file),
            "payload": section,
            "verdict": verdict,
            "notes": identified.notes,
            "report": str(identified.report),
        }
    )
    section.print(console)
    console.verdict(verdict.passed, verdict.headline)
    console.say(verdict.sentence)
    console.say(f"Payload: {file}")
    console.say(f"Report: {identified.report}")
    if not verdict.passed:
        raise SystemExit(ExitCode.VERDICT_FAILED if identified.fits else ExitCode.DATA_QUALITY)
    console.next_step("payload", "export", file, "--to", "FORMAT", "-o", "FILE")
