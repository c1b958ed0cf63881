"""A stop between two motions of a job: the first motion is kept, and the next motion does not
start.
"""

from __future__ import annotations

import contextlib
import json
import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from acquisition.motion.motion_file import load_motion
from acquisition.runs.catalogue import list_runs
from acquisition.runs.folder import RunFolder
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.states import TaskProgress, TaskState
from config.load import load_cell
from rid_daq.app import run
from rid_daq.operations.cell import axis_tester, zeroed_plate
from rid_daq.operations.cell.axis_tester import AxisTester
from rid_daq.operations.cell.plate_zero import PlateZeroRequest
from rid_daq.operations.cell.zeroed_plate import zero_plate
from rid_daq.operations.experiment import recorded_motion
from rid_daq.operations.experiment.record import RecordRequest
from rid_daq.operations.experiment.recorded_motion import record_motion_file
from rid_daq.operations.payload import session_steps
from rid_daq.operations.payload.payload_estimate import PayloadRequest
from rid_daq.operations.payload.payload_session import PayloadSessionRequest
from rid_daq.operations.payload.session_states import SessionFile
from rid_daq.operations.payload.session_steps import PayloadGuide
from rid_daq.recording import run_session
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.recording.run_request import RunRequest
from rid_daq.recording.run_session import RunSession
from rid_daq.report.result import Result
from rid_daq.terminal.console import Console
from rid_daq.terminal.exit_codes import ExitCode
from rid_daq.terminal.motion_progress import progress_callback
from tests.rid_daq.recording.test_recorded_run import outcome

LATE = StopReason(StopCode.STOP_BUTTON, "stopped once the motion was over; no other one is begun")


@pytest.fixture
def executed_motions(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[str]:
    """Return a list that receives the role of each executed motion.

    Each motion reaches its end, and a stop arrives just after it.
    """
    roles: list[str] = []

    @contextlib.contextmanager
    def recording(session: RunSession, request: RunRequest) -> Iterator[RecordedRun]:
        roles.append(request.role)
        ended = replace(outcome(), late_stop=LATE)
        result = Result.new("Recording", "arm")
        yield RecordedRun(RunFolder.create(tmp_path, "a run"), ended, None, None, result)

    @contextlib.contextmanager
    def opened(loaded: Any, runs: Path, console: Console, *_: Any, **__: Any) -> Iterator[Any]:
        yield RunSession(loaded, loaded.config, runs, console)

    monkeypatch.setattr(RunSession, "recording", recording)
    monkeypatch.setattr(session_steps, "preflight", lambda *_, **__: ([], None))
    for module in (recorded_motion, zeroed_plate):
        monkeypatch.setattr(module, "open_session", opened)
    return roles


def require_stopped(ended: RecordedRun) -> None:
    assert ended.outcome.stop is LATE
    assert ended.exit_code is ExitCode.STOPPED
    assert ended.stop_sentence.startswith("Stopped once the motion was over; no other one is begun")


def test_a_stop_after_the_rehearsal_prevents_the_motion(
    executed_motions: list[str], six_axis_motion: Callable[[int], Path], tmp_path: Path
) -> None:
    request = RecordRequest(cell="kr15", motion=six_axis_motion(2), runs=tmp_path, rehearse=True)
    recorded = record_motion_file(request, Console())
    assert recorded.rehearsal_only
    assert executed_motions == ["rehearsal"]
    require_stopped(recorded.run)


def test_a_late_stop_of_a_single_motion_keeps_the_recording(
    executed_motions: list[str], six_axis_motion: Callable[[int], Path], tmp_path: Path
) -> None:
    request = RecordRequest(cell="kr15", motion=six_axis_motion(2), runs=tmp_path)
    recorded = record_motion_file(request, Console())
    assert executed_motions == ["recording"]
    assert recorded.run.exit_code is ExitCode.DONE


def test_a_stop_after_the_approach_prevents_the_plate_poses(
    executed_motions: list[str], tmp_path: Path
) -> None:
    zeroed = zero_plate(PlateZeroRequest(cell="ir361", runs=tmp_path), Console())
    assert zeroed.approach_only
    assert executed_motions == ["approach"]
    require_stopped(zeroed.run)


def test_a_stop_after_a_payload_step_keeps_it_and_prevents_the_next(
    executed_motions: list[str],
    six_axis_motion: Callable[[int], Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        PayloadGuide, "_recorded_averages", lambda _guide: None
    )  # nothing was measured
    loaded = load_cell("kr15")
    state = SessionFile.begin(RunFolder.create(tmp_path, "payload", kind="payload session"), "kr15")
    simulated = SimpleNamespace(attach=lambda payload: None)
    guide = PayloadGuide(
        PayloadSessionRequest(cell="kr15", runs=tmp_path, warm_up_percent=0.0, repeats=1),
        RunSession(loaded, loaded.config, tmp_path, Console(), cast("Any", simulated)),
        state,
        cast("Any", load_motion(six_axis_motion(2))),
        PayloadRequest(),
        Console(),
    )
    for step in ("rehearsal", "unloaded"):  # the session is resumed each time
        failed = guide.perform_steps()
        assert failed is not None
        assert failed[0] == step
        require_stopped(failed[1])
    assert guide.perform_steps() is None  # no motion follows the last one
    assert executed_motions == list(state.done) == ["rehearsal", "unloaded", "loaded 1"]


def test_a_stop_after_an_axis_test_prevents_the_next(
    executed_motions: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    loaded = load_cell("ir361")
    session = RunSession(loaded, loaded.config, tmp_path, Console())
    monkeypatch.setattr(
        axis_tester,
        "record_held",
        lambda session, console, held: session.record(RunRequest("", "", None, role=held.role)),
    )
    monkeypatch.setattr(axis_tester, "true_position_reader", lambda _session: None)
    bench = AxisTester(session, Console(), unattended=True)
    assert bench.test(0) is None
    assert executed_motions == ["axis test"]
    require_stopped(bench.last)


@pytest.mark.slow
def test_a_signal_at_the_end_of_a_rehearsal_ends_the_command(
    workshop: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def interrupting(*arguments: Any) -> Callable[[TaskProgress], None]:
        shown = progress_callback(*arguments)

        def look(progress: TaskProgress) -> None:
            if progress.state is TaskState.FINISHED:
                signal.raise_signal(signal.SIGTERM)
            shown(progress)

        return look

    monkeypatch.setattr(run_session, "progress_callback", interrupting)
    before = signal.getsignal(signal.SIGTERM)
    files = [str(workshop / "cell.yaml"), str(workshop / "validation.yaml")]
    try:
        assert run(["record", *files, "--runs", str(tmp_path), "--rehearse", "--json"]) == 143
    finally:
        signal.signal(signal.SIGTERM, before)
    result = json.loads(capsys.readouterr().out)
    assert result["stop"]["code"] == "INTERRUPTED"
    ((_, manifest),) = list_runs(tmp_path)
    assert manifest.status == "complete"
