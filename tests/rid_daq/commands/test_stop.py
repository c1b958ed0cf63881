"""`rid-daq stop` from another process, during a motion and without a session."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from acquisition.journal.cycles import read_journal
from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import Phase
from acquisition.runs.folder import RunFolder
from acquisition.session.record import record_motion
from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from acquisition.task.program_words import ProgramWords
from acquisition.task.states import TaskProgress, TaskState
from config.load import LoadedCell, load_cell
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from rid_daq.app import run
from rid_daq.session.running_sessions import RunningSession, running_sessions
from rid_daq.session.session import hold_cell

pytestmark = pytest.mark.slow

STOP = [sys.executable, "-m", "rid_daq", "stop", "--json"]
HOLDER = """
import sys
from config.load import load_cell
from rid_daq.app import _end_once
from rid_daq.session.session import hold_cell
import signal
signal.signal(signal.SIGTERM, _end_once)
with hold_cell(load_cell("ir361").config):
    print("held", flush=True)
    signal.pause()
"""


@pytest.fixture(autouse=True)
def separate_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Use separate locks, so that no test stops other programs of this computer."""
    monkeypatch.setenv("RID_DAQ_LOCKS", str(tmp_path))


@pytest.fixture(scope="module")
def loaded() -> LoadedCell:
    return load_cell("ir361")


def long_motion(loaded: LoadedCell) -> FourierMotion:
    joints = tuple(
        FourierJoint(joint=name, sine=(0.2,), cosine=(0.1,)) for name in loaded.robot.joint_names
    )
    return FourierMotion(
        kind="fourier", robot="ir361", period_s=2.0, periods=900, ramp_s=1.0, joints=joints
    )


@pytest.mark.fault(23)
def test_stop_in_another_process_stops_a_motion_and_confirms_rest(
    loaded: LoadedCell, tmp_path: Path, measured: Callable[[str], None]
) -> None:
    assert loaded.plant is not None
    samples = long_motion(loaded).plan(loaded.robot, loaded.config.cycle_time_s)
    folder = RunFolder.create(tmp_path / "runs", "test")
    commands: list[subprocess.Popen[str]] = []

    def stop_once(progress: TaskProgress) -> None:
        if progress.phase is Phase.MAIN and not commands:
            commands.append(subprocess.Popen(STOP, stdout=subprocess.PIPE, text=True))

    with (
        SimulatedCell(
            CellSimulation(loaded.config, loaded.robot, loaded.plant, realtime=False, seed=1)
        ) as simulated,
        hold_cell(simulated.cell),
    ):
        outcome = record_motion(
            simulated.cell, loaded.robot, samples, folder, on_progress=stop_once
        )
        axes = simulated.axes()
    output, _ = commands[0].communicate(timeout=120.0)
    assert commands[0].returncode == 0
    (session,) = json.loads(output)["sessions"]
    assert (session["process"], session["cell"]) == (os.getpid(), "ir361")
    assert session["stopped"]
    assert "all axes at rest" in session["text"]
    assert outcome.stop is not None
    assert outcome.stop.code is StopCode.STOP_COMMAND
    assert outcome.stop.text == "stopped by `rid-daq stop`"
    assert not axes.enabled.any()
    np.testing.assert_allclose(axes.velocity, 0.0, atol=1e-6)
    assert read_journal(outcome.path).damage.notes == ()
    measured("`rid-daq stop` during a motion: " + session["text"].partition("; ")[2].split(",")[0])


def test_stop_ends_a_session_by_the_cell_name_of_a_damaged_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER], stdout=subprocess.PIPE, text=True
    ) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        assert run(["stop", "another_cell"]) == 1
        output = capsys.readouterr().out
        assert "No session runs on cell another_cell" in output
        assert re.search(r"Still running: .* on ir361 .*`rid-daq stop ir361` stops it", output)
        torn = tmp_path / "cell.yaml"
        torn.write_text("format: [\nname: ir361 # as it was\n}{")
        assert run(["stop", str(torn)]) == 0
    assert holder.returncode == 143


def test_stop_without_a_session_fails_with_a_message(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["stop", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["sessions"] == []


def test_an_unlocked_lock_file_is_not_a_session(loaded: LoadedCell) -> None:
    with hold_cell(loaded.config):
        (session,) = running_sessions("ir361")
        assert session.pid == os.getpid()
        assert session.is_running
    assert running_sessions("ir361") == []
    assert not session.is_running


def test_a_motion_that_has_just_ended_counts_as_stopped(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    control = ControlBlock.create()
    monkeypatch.setattr(
        RunningSession,
        "control",
        lambda session: control if not control.program.stop_code else None,
    )

    def end(_: ProgramWords, code: StopCode) -> None:
        control.program.declare_task_gone()
        control.task.power_off = True
        control.task.state = TaskState.FINISHED

    monkeypatch.setattr(ProgramWords, "request_stop", end)
    session = RunningSession(Path("x"), 17, "rid-daq record", "ir361")
    monkeypatch.setattr("rid_daq.session.running_sessions.running_sessions", lambda cell: [session])
    assert run(["stop", "--json"]) == 0
    (stopped,) = json.loads(capsys.readouterr().out)["sessions"]
    assert stopped["stopped"]
