"""Outcome of a recorded motion as text, verdict and exit code."""

from __future__ import annotations

import signal
from dataclasses import replace
from pathlib import Path

import pytest

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from acquisition.session.outcome import RecordOutcome
from acquisition.session.timing import CycleTally
from acquisition.supervision.stop_reason import StopCode, StopReason
from config.errors import DataQualityError, RecordingError
from rid_daq.recording.recorded_run import (
    RecordedRun,
    prefix_errors_with_outcome,
    stop_document,
    stop_words,
)
from rid_daq.report.result import Result
from rid_daq.runs.run_quality import RunQuality
from rid_daq.terminal.exit_codes import ExitCode
from tests.builders.raised_codes import raises_code

LOST = StopReason(StopCode.MISSED_FRAMES, "axis2: 10 answers in a row are missing")
TROUBLE = "joint 'axis1': 12 of 100 rows of the motion are missing"


def outcome(stop: StopReason | None = None) -> RecordOutcome:
    return RecordOutcome(
        path=Path("recording.mcap"),
        stop=stop,
        interrupted_by=None,
        rows=0,
        statistics=CycleTally(1).statistics(),
        notes=(),
    )


@pytest.fixture
def ended_run(tmp_path: Path) -> RecordedRun:
    """Return a motion that ended as planned without lost answers."""
    folder = RunFolder.create(tmp_path, "a run")
    quality = RunQuality(("axis1",), 100, (0,))
    return RecordedRun(folder, outcome(), None, quality, Result.new("Recording", "arm"))


def test_a_complete_run_gives_exit_code_0(ended_run: RecordedRun) -> None:
    verdict = ended_run.verdict([])
    assert (ended_run.status, ended_run.exit_code) == (RunStatus.COMPLETE, ExitCode.DONE)
    assert (verdict.headline, verdict.passed) == ("Recorded completely", None)
    assert ended_run.stop_sentence == ""


def test_reached_goals_replace_the_timing_in_the_verdict(ended_run: RecordedRun) -> None:
    goals = ["sx3 reached after 5 periods", "fv_axis1 reached after 6 periods"]
    sentence = ended_run.verdict(goals).sentence
    assert sentence == "sx3 reached after 5 periods. fv_axis1 reached after 6 periods."


def test_too_many_lost_answers_come_first_and_give_exit_code_6(ended_run: RecordedRun) -> None:
    poor = replace(ended_run, quality=RunQuality(("axis1",), 100, (12,), trouble=TROUBLE))
    verdict = poor.verdict([])
    assert poor.exit_code == ExitCode.DATA_QUALITY
    assert (verdict.passed, verdict.headline) == (
        False,
        "Recorded, but the data are not good enough for the next step",
    )
    assert verdict.sentence.startswith(f"{TROUBLE}. ")
    assert "12 of axis1" in verdict.sentence


@pytest.mark.parametrize(
    ("held", "after"), [(False, "; the robot moves to the start pose by itself"), (True, "")]
)
def test_the_stop_sentence_announces_automatic_motion_only_without_a_held_key(
    ended_run: RecordedRun, held: bool, after: str
) -> None:
    reason = StopReason(StopCode.STOP_COMMAND, "stopped by `rid-daq stop`")
    stopped = replace(ended_run, outcome=outcome(reason), quality=None, held=held)
    assert stopped.stop_sentence == (
        f"Stopped by `rid-daq stop`. Start again when you are ready{after}."
    )


def test_the_stop_sentence_gives_cause_place_and_advice(ended_run: RecordedRun) -> None:
    stopped = replace(ended_run, outcome=outcome(LOST), quality=None)
    verdict = stopped.verdict(["never told"])
    assert (stopped.status, stopped.exit_code) == (RunStatus.STOPPED, ExitCode.COMMUNICATION)
    assert verdict.sentence == (
        "Stopped: axis2: 10 answers in a row are missing. Check cable and bus load, then run"
        " `rid-daq check`."
    )
    assert verdict.passed is False


@pytest.mark.parametrize(
    ("came", "code"),
    [(signal.SIGINT, ExitCode.INTERRUPTED), (signal.SIGTERM, ExitCode.TERMINATED)],
)
def test_a_signal_determines_the_exit_code(
    ended_run: RecordedRun, came: signal.Signals, code: ExitCode
) -> None:
    reason = StopReason(StopCode.INTERRUPTED, "stopped by the user or by the end of the program")
    stopped = replace(ended_run, outcome=replace(outcome(reason), interrupted_by=came))
    assert stop_words(stopped.outcome) == "Stopped by the user or by the end of the program."
    assert stopped.exit_code == code


def test_the_stop_document_contains_code_and_notes() -> None:
    assert stop_document(outcome()) == {"stop": None, "notes": []}
    result = stop_document(replace(outcome(LOST), notes=("the recorder died",)))
    assert result["stop"] == {"code": "MISSED_FRAMES", "text": LOST.text}
    assert result["notes"] == ["the recorder died"]


def test_an_empty_recording_is_refused_when_it_is_used(ended_run: RecordedRun) -> None:
    with raises_code(DataQualityError, "RID-RECORDING-EMPTY"):
        _ = ended_run.measured


@pytest.mark.parametrize(
    ("stop", "words"),
    [
        (None, "The motion ended as planned. That was the rehearsal. disk full"),
        (LOST, f"Stopped: {LOST.text}. That was the rehearsal. disk full"),
    ],
)
def test_a_storage_error_includes_the_outcome_of_the_motion(
    stop: StopReason | None, words: str
) -> None:
    with (
        pytest.raises(RecordingError) as failed,
        prefix_errors_with_outcome(outcome(stop), "That was the rehearsal."),
    ):
        raise RecordingError("disk full")
    assert str(failed.value) == words
