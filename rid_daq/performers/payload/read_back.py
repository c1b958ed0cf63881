"""What `rid-daq payload read-back` does, and says of it."""

from __future__ import annotations

from identification.choices import REPORTED
from identification.payload.body import REPORTED_UNITS
from rid_daq.blocks.formats import number
from rid_daq.jobs.payload.load_data_job import ReadBackRequest, read_back_payload
from rid_daq.terminal.console import Console
from rid_daq.terminal.exit_codes import ExitCode


def perform(request: ReadBackRequest, console: Console) -> None:
    """Compare, and say the verdict; exit codes as the command has them."""
    found = read_back_payload(request)
    measured, read, verdict = found.measured.reported, found.found.reported, found.verdict
    console.document(
        {
            "file": request.source,
            "format": request.form.value,
            "verdict": verdict,
            "read": dict(zip(REPORTED, read.tolist(), strict=True)),
        }
    )
    console.table(
        ("parameter", "measured", "read", "unit"),
        [
            (name, number(float(wanted), 6), number(float(held), 6), unit)
            for name, unit, wanted, held in zip(
                REPORTED, REPORTED_UNITS, measured, read, strict=True
            )
        ],
    )
    console.verdict(verdict.passed, verdict.headline)
    if not verdict.passed:
        raise SystemExit(ExitCode.VERDICT_FAILED)
