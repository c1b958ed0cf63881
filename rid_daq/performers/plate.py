"""What `rid-daq plate` does, and says of it."""

from __future__ import annotations

from config.cell.plate import PlateZero
from rid_daq.recording.plate_zero_job import PlateZeroed, PlateZeroRequest, zero_plate
from rid_daq.recording.recorded_run import stop_document
from rid_daq.report.shown.plate import plate_zero_blocks
from rid_daq.terminal.console import Console
from rid_daq.terminal.exit_codes import ExitCode
from rid_daq.terminal.shown_blocks import show


def perform(request: PlateZeroRequest, console: Console) -> None:
    """Zero the plate, and say how well; exit codes as the command has them."""
    zeroed = zero_plate(request, console)
    if zeroed.zero is None:
        _print_stop(console, zeroed)
        raise SystemExit(zeroed.run.exit_code)
    _print(console, zeroed, zeroed.zero)
    if not zeroed.run.result.verdict.passed:
        raise SystemExit(ExitCode.VERDICT_FAILED)


def _print_stop(console: Console, zeroed: PlateZeroed) -> None:
    run = zeroed.run
    kept = {} if zeroed.approach_only else {"folder": str(run.folder.path)}
    console.document(kept | stop_document(run.outcome))
    console.verdict(False, run.stop_sentence)
    if not zeroed.approach_only:
        console.say("The plate is not zeroed: start again, or `record` measures from a wrong zero.")
        console.say(f"Report: {run.report}")


def _print(console: Console, zeroed: PlateZeroed, zero: PlateZero) -> None:
    run, written = zeroed.run, zeroed.written
    section, judged = run.result.plate_zero, run.result.verdict
    assert section is not None
    console.document(
        {
            "folder": str(run.folder.path),
            "report": str(run.report),
            "zero": zero.model_dump(mode="json"),
            "plate_zero": section,
            "verdict": judged,
            "written": None if written is None else str(written),
        }
    )
    show(plate_zero_blocks(section), console)
    console.verdict(judged.passed, f"{judged.headline}. {judged.sentence}")
    console.say(f"Report: {run.report}")
    if written is not None:
        console.say(f"4 of 4: written into {written}")
    elif judged.passed:
        console.say("4 of 4: put these lines under `plate:` in the cell file (--write does it):")
        console.say(zeroed.lines.rstrip("\n"))
