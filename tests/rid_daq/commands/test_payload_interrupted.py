"""Ctrl-C in a payload session, `--resume` after it, `--repeats` and `--until-mass`."""

from __future__ import annotations

import json
import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from acquisition.journal.cycles import read_journal
from acquisition.runs.manifest import RECORDING
from config.errors import RidDaqError
from config.load import load_cell, to_yaml
from config.simulation.faults import FaultScript, FrameFault
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from rid_daq.app import run

pytestmark = pytest.mark.slow

PATIENCE_S = 300.0


@pytest.fixture(scope="module")
def motion(six_axis_motion: Callable[[int], Path]) -> Path:
    return six_axis_motion(8)


def is_recording(runs: Path) -> bool:
    """Return True if a run in a folder has more than 100 rows."""
    for file in runs.glob(f"*/{RECORDING}"):
        try:
            if len(read_journal(file).rows) > 100:
                return True
        except RidDaqError:  # the file is not readable yet
            continue
    return False


def interrupt_when_moving(runs: Path) -> threading.Thread:
    def wait() -> None:
        until_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < until_s and not is_recording(runs):
            time.sleep(0.02)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=wait)
    thread.start()
    return thread


def test_a_session_resumes_after_ctrl_c_and_until_mass_ends_its_runs_early(
    motion: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = tmp_path / "runs"
    words = [
        "payload", "kr15", "--motion", str(motion), "--runs", str(runs), "--yes",
        "--payload", "large", "--rehearsal", "0", "--warm-up", "0", "--centre-limit", "50",
        "--repeats", "2", "--until-mass", "5",
    ]  # fmt: skip
    thread = interrupt_when_moving(runs)
    code = run(words)
    thread.join()
    output = capsys.readouterr().out
    assert code == 130
    assert "Stopped in step unloaded" in output
    (state_file,) = runs.glob("*/session.json")
    session = state_file.parent.name
    assert f"--resume {session}" in output
    assert json.loads(state_file.read_text(encoding="utf-8"))["done"] == {}

    assert run([*words, "--resume", session, "--json"]) in (0, 1)
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    report = Path(document["report"])
    assert "Lost answers" not in report.read_text(encoding="utf-8")  # for rows after an early end
    assert document["session"] == session
    assert list(document["done"]) == ["unloaded", "loaded 1", "loaded 2"]
    lengths = {
        name: len(read_journal(runs / run_id / RECORDING).rows)
        for name, run_id in document["done"].items()
    }
    # After three of eight periods the mass is accurate to 5 kg, so the loaded runs end early.
    assert lengths["loaded 1"] < 0.7 * lengths["unloaded"]
    assert lengths["loaded 2"] < 0.7 * lengths["unloaded"]
    for name in ("loaded 1", "loaded 2"):
        page = runs / document["done"][name] / "report.html"
        assert "Lost answers" not in page.read_text(encoding="utf-8")
    repeats = document["payload"]["repeats"]
    assert repeats["runs"] == 2
    assert repeats["ratio"] > 0.0
    assert "Simulated: large was on the flange." in document["payload"]["findings"][-1]


@pytest.mark.long
@pytest.mark.fault(3)
def test_a_step_with_too_many_lost_answers_is_repeated_by_resume(
    motion: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    measured: Callable[[str], None],
) -> None:
    kr15 = load_cell("kr15")
    assert kr15.plant is not None
    lost = [FrameFault(kind="drop", joint="axis2", at_cycle=400 + 10 * k) for k in range(300)]
    script = FaultScript(bus=tuple(lost))
    runs = tmp_path / "runs"
    with SimulatedCell(
        CellSimulation(kr15.config, kr15.robot, kr15.plant, realtime=False, seed=1, faults=script)
    ) as lossy:
        cell = tmp_path / "cell.yaml"
        cell.write_text(to_yaml(lossy.cell))
        words = [
            "payload", str(cell), "--motion", str(motion), "--runs", str(runs), "--yes",
            "--rehearsal", "0", "--warm-up", "0",
        ]  # fmt: skip
        assert run(words) == 6
    output = capsys.readouterr().out
    assert "Step unloaded is not good enough to identify the payload: joint 'axis2': " in output
    (state_file,) = runs.glob("*/session.json")
    assert f"--resume {state_file.parent.name}" in output
    assert json.loads(state_file.read_text(encoding="utf-8"))["done"] == {}
    measured("'payload': too many lost answers: exit code 6, and --resume records the run again")
