"""What `rid-daq payload CELL` does, and says of it."""

from __future__ import annotations

from rid_daq.recording.payload_session_job import PayloadSessionResult, run_payload_session
from rid_daq.recording.payload_session_request import PayloadSessionRequest
from rid_daq.recording.payload_steps import StepFailed
from rid_daq.recording.recorded_run import stop_document
from rid_daq.report.shown.payload import payload_blocks
from rid_daq.terminal.console import Console, as_command
from rid_daq.terminal.exit_codes import ExitCode
from rid_daq.terminal.options import DEFAULT_RUNS
from rid_daq.terminal.shown_blocks import show


def perform(request: PayloadSessionRequest, console: Console) -> None:
    """Lead through a session, and say its verdict; exit codes as the command has them."""
    ended = run_payload_session(request, console)
    if isinstance(ended, StepFailed):
        _print_failed(console, ended, request)
        raise SystemExit(ended.run.exit_code)
    _print(console, ended)
    if not ended.judged.passed:
        raise SystemExit(ExitCode.VERDICT_FAILED if ended.judged.fits else ExitCode.DATA_QUALITY)


def _print_failed(console: Console, failed: StepFailed, request: PayloadSessionRequest) -> None:
    run, name = failed.run, failed.name
    told: dict[str, object] = {"step": name, "folder": str(run.folder.path)}
    words = ("payload", request.cell, "--resume", failed.session_id)
    elsewhere = () if request.runs == DEFAULT_RUNS else ("--runs", request.runs)
    resume = as_command(*words, *elsewhere)
    if run.outcome.stop is not None:
        console.document(told | stop_document(run.outcome))
        console.verdict(False, f"Stopped in step {name}: {run.outcome.stop.text}")
        console.say(f"Go on with: {resume}")
    elif run.quality is not None:
        console.document(told | {"quality": run.quality.to_dict()})
        trouble = run.quality.trouble
        console.verdict(False, f"Step {name} is not good enough to identify the payload: {trouble}")
        console.say(f"Drive it again with: {resume}")


def _print(console: Console, ended: PayloadSessionResult) -> None:
    state, result = ended.state, ended.result
    console.document(
        {
            "session": state.folder.run_id,
            "file": str(ended.file),
            "payload": result.payload,
            "verdict": result.verdict,
            "done": state.done,
            "facts": state.facts,
            "report": str(ended.report),
        }
    )
    if result.payload is not None:
        show(payload_blocks(result.payload), console)
    console.verdict(ended.judged.passed, result.verdict.headline)
    console.say(result.verdict.sentence)
    console.say(f"Payload: {ended.file}")
    console.say(f"Report: {ended.report}")
    if ended.judged.passed:
        console.next_step("payload", "export", ended.file, "--to", "FORMAT", "-o", "FILE")
        console.next_step("payload", "certificate", state.folder.path, "--by", "NAME")
