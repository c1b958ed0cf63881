"""What `rid-daq record` does, and says of it."""

from __future__ import annotations

from typing import Final

from rid_daq.recording.accuracy_watch import AccuracyWatch
from rid_daq.recording.record_job import (
    REHEARSAL_ALONE,
    MotionRecorded,
    RecordRequest,
    record_motion_file,
)
from rid_daq.recording.recorded_run import stop_document
from rid_daq.terminal.console import Console

SINGLE_PERIODS: Final = (
    "It is of rows of single periods, with their noise and reversals. The residual that `identify`"
    " prints is another quantity: of the mean of the periods, with reversals left free."
)


def perform(request: RecordRequest, console: Console) -> None:
    """Record, and say what became of it; exit codes as the command has them."""
    recorded = record_motion_file(request, console)
    _print(console, recorded)
    if recorded.exit_code:
        raise SystemExit(recorded.exit_code)


def _print(console: Console, recorded: MotionRecorded) -> None:
    run, accuracy = recorded.run, recorded.accuracy
    if recorded.rehearsal_only:
        console.document({"rehearsal": str(run.folder.path), **stop_document(run.outcome)})
        console.verdict(False, f"{run.stop_sentence} {REHEARSAL_ALONE}")
        return
    told = None if accuracy is None else _accuracy_document(accuracy)
    console.document(run.document() | {"accuracy": told})
    console.say(run.timing_sentence)
    if accuracy is not None and accuracy.running is not None:
        console.say(f"Running estimate: {accuracy.running_sentence()}")
        console.say(SINGLE_PERIODS)
    for sentence in [] if accuracy is None else accuracy.sentences():
        console.say(sentence)
    if run.print_verdict(console):
        console.next_step(*recorded.motion.next_command(run.folder.path))


def _accuracy_document(accuracy: AccuracyWatch) -> dict[str, object]:
    running = accuracy.running
    return {
        "relative_percent": None if running is None else running.relative_percent.tolist(),
        "relative_percent_of": "single periods",
        "reached": accuracy.reached if accuracy.goals else None,
        "periods": accuracy.periods,
        "goals": accuracy.sentences(),
    }
