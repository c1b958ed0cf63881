"""What `rid-daq axes` does, and says of it."""

from __future__ import annotations

from dataclasses import asdict

from rid_daq.commissioning.axis_test_job import AxesTested, AxisTestRequest, check_axes
from rid_daq.recording.recorded_run import stop_document
from rid_daq.terminal.console import Console
from rid_daq.terminal.exit_codes import ExitCode


def perform(request: AxisTestRequest, console: Console) -> None:
    """Test the axes, and say what they do; exit codes as the command has them."""
    tested = check_axes(request, console)
    console.document(_document(tested))
    if tested.stopped is not None:
        words = tested.stopped.stop_sentence or "The test was ended."
        console.verdict(False, f"{words} The axis test is not complete.")
        raise SystemExit(tested.stopped.exit_code or ExitCode.VERDICT_FAILED)
    if not tested.passed:
        console.verdict(False, "Not every axis does what the files say: change the lines above.")
        console.next_step("axes", request.cell)
        raise SystemExit(ExitCode.VERDICT_FAILED)
    signed = "" if tested.signed is None else f" Signed in {tested.signed}."
    console.verdict(True, f"Every axis that was tested does what the files say.{signed}")
    console.next_step("check", request.cell)


def _document(tested: AxesTested) -> dict[str, object]:
    stopped = tested.stopped
    return {
        "cell": tested.cell,
        "passed": tested.passed,
        "axes": [
            {
                "motion": asdict(each.motion),
                "seen": asdict(each.seen),
                "passed": each.passed,
                "problems": list(each.problems),
            }
            for each in tested.verdicts
        ],
        "stopped": None if stopped is None else stopped.document(),
        **({} if stopped is None else stop_document(stopped.outcome)),
        "signed": None if tested.signed is None else str(tested.signed),
    }
