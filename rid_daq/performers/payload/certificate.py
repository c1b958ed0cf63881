"""What `rid-daq payload certificate` does, and says of it."""

from __future__ import annotations

from rid_daq.recording.certificate_job import PayloadCertificateRequest, write_certificate
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output
from rid_daq.terminal.console import Console


def perform(request: PayloadCertificateRequest, console: Console) -> None:
    """Write a certificate, and say where it is."""
    refuse_output(request.output, request.overwrite, made_file.CERTIFICATE)
    certified, file = write_certificate(request)
    verdict = certified.verdict
    console.document(
        {
            "file": str(file),
            "run": certified.run_id,
            "simulated": certified.simulated,
            "verdict": verdict,
        }
    )
    if certified.simulated:
        console.say("The cell is simulated; every page says so.")
    console.say(f"Verdict on it: {verdict.headline}")
    console.verdict(True, f"Wrote {file}")
