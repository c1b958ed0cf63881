"""What `rid-daq validate` does, and says of it."""

from __future__ import annotations

from rid_daq.jobs.validate_job import Validated, ValidateRequest, predict_motion, validate_run
from rid_daq.report.shown.plate import base_load_blocks, reaction_blocks
from rid_daq.terminal.console import Console
from rid_daq.terminal.exit_codes import ExitCode
from rid_daq.terminal.shown_blocks import show


def perform(request: ValidateRequest, console: Console) -> None:
    """Validate, and say the verdict; exit codes as the command has them."""
    if request.is_motion_file:
        validated = predict_motion(request)
    else:
        validated = validate_run(request, console)
    _print(console, validated)
    if validated.verdict.passed is False:
        console.next_step("docs", "find-a-mistake")
        raise SystemExit(ExitCode.VERDICT_FAILED)
    if not request.is_motion_file:
        console.next_step("export", request.model, "--to", "FORMAT", "-o", "FILE")


def _print(console: Console, validated: Validated) -> None:
    report = validated.report
    told = {
        "validation": validated.validation,
        "reaction": validated.reaction,
        "base_load": validated.base_load,
        "verdict": validated.verdict,
        "notes": validated.notes,
        "clocks": validated.clocks,
        "report": None if report is None else str(report),
    }
    console.document({name: part for name, part in told.items() if part is not None})
    if validated.validation is not None:
        validated.validation.print(console)
    if validated.reaction is not None:
        show(reaction_blocks(validated.reaction), console)
    if validated.base_load is not None:
        show(base_load_blocks(validated.base_load), console)
    console.verdict(validated.verdict.passed, validated.verdict.headline)
    if report is not None:
        console.say(f"Report: {report}")
