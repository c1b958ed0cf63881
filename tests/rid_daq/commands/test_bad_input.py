"""Frequent user errors: one clear message, the right exit code, no traceback."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.load import load_cell
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from rid_daq.app import run
from rid_daq.operations.payload.session_states import SessionFile

MOTION = """\
kind: fourier
robot: ir361
period_s: 10.0
joints:
  - {joint: axis1, sine: [0.1], cosine: [0.0]}
  - {joint: axis2, sine: [0.1], cosine: [0.0]}
  - {joint: axis3, sine: [0.1], cosine: [0.0]}
"""
MAP = """\
name: two_joints
robot: two.yaml
columns: 5
time: {column: 0}
joints:
  - {joint: a, position: 1, torque: 2}
  - {joint: b, position: 3, torque: 4}
torques: motor_torque
"""


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with valid and damaged files, an unreachable real cell, and runs."""
    folder = tmp_path_factory.mktemp("prepared")
    write = {
        "good.yaml": MOTION,
        "unknown_key.yaml": MOTION.replace("period_s", "perod_s"),
        "other_robot.yaml": MOTION.replace("ir361", "kr15"),
        "too_far.yaml": MOTION.replace("axis2, sine: [0.1]", "axis2, sine: [2.5]"),
        "odd_period.yaml": MOTION.replace("10.0", "9.999"),
        "missing_joint.yaml": MOTION.replace(
            "  - {joint: axis3, sine: [0.1], cosine: [0.0]}\n", ""
        ),
        "tag.yaml": "kind: !!python/object/apply:os.system ['true']\n",
        "octal.yaml": MOTION.replace("10.0", "010"),
        "empty.yaml": "",
        "binary.csv": "\x00\x01\x02" * 400,
        "text.csv": "once upon a time\n" * 300,
        "empty.csv": "",
        "model.json": "{}",
        "mine.map.yaml": MAP,
    }
    for name, text in write.items():
        (folder / name).write_text(text)
    run(["init", str(folder / "real")])
    cell = folder / "real" / "cell.yaml"
    text = cell.read_text().replace("simulated: true\n", "").replace("plant: ir361", "# plant")
    cell.write_text(
        text.replace(
            "interface: rid_sim, channel: my_cell", "interface: socketcan, channel: nocan9"
        )
    )
    run(["init", str(folder / "bridged")])
    bridged = folder / "bridged" / "cell.yaml"
    text = bridged.read_text().replace("rid_sim, channel: my_cell", "socketcan, channel: nocan9")
    bridged.write_text(text)
    session = RunFolder.create(folder / "runs", "session", kind="payload session")
    SessionFile.begin(session, "kr15")
    empty = RunFolder.create(folder / "runs", "nothing")
    empty.finish(RunStatus.STOPPED)
    spoilt = RunFolder.create(folder / "runs", "spoilt")
    spoilt.write("result.json", b"{]")
    spoilt.finish(RunStatus.COMPLETE)
    return folder


@pytest.fixture
def working_folder(prepared: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a working folder with a copy of the prepared files."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(prepared, tmp_path, dirs_exist_ok=True, symlinks=True)
    return tmp_path


TABLE: list[tuple[str, int, str]] = [
    ("record ir362 good.yaml", 2, "Did you mean ir361"),
    ("record missing/cell.yaml good.yaml", 2, "cannot read"),
    ("record ir361 missing.yaml", 2, "cannot read"),
    ("record ir361 unknown_key.yaml", 2, "unknown_key.yaml:3:1"),
    ("record ir361 other_robot.yaml", 2, "is for 'kr15'"),
    ("record ir361 too_far.yaml", 3, "axis2"),
    ("record ir361 odd_period.yaml", 2, "whole number of cycles"),
    ("record ir361 missing_joint.yaml", 2, "axis3"),
    ("record ir361 tag.yaml", 2, "tag"),
    ("record ir361 octal.yaml", 2, "octal"),
    ("record ir361 empty.yaml", 2, "empty"),
    ("record ir361 real", 2, "is a folder; give real/motion.yaml"),
    ("record ir361 good.yaml --label ../../etc", 2, "label"),
    ("record ir361 good.yaml --runs good.yaml", 7, "RID-FILE-NOT-FOLDER"),
    ("record ir361 good.yaml --seed -1", 2, "--seed"),
    ("record real/cell.yaml real/motion.yaml", 3, "rid-daq axes real"),
    (
        "record real/cell.yaml real/motion.yaml --without-axis-test --i-have-cleared-the-cell"
        " --pace 2",
        2,
        "RID-CELL-NOT-OURS",
    ),
    ("record bridged/cell.yaml real/motion.yaml --pace 2", 2, "RID-MOCK-REAL-TIME"),
    ("drives rollback ir361 nothing", 2, "RID-WRITE-LOG-EMPTY"),
    ("payload ir361 --resume session", 2, "RID-SESSION-OTHER-CELL"),
    ("record real/cell.yaml real/motion.yaml --without-axis-test", 3, "clear the cell"),
    ("record real/cell.yaml real/motion.yaml --i-have-cleared-the-cell", 3, "rid-daq axes real"),
    (
        "record real/cell.yaml real/motion.yaml --i-have-cleared-the-cell --without-axis-test",
        4,
        "nocan9",
    ),
    ("axes real/cell.yaml", 3, "run the command in a terminal"),
    ("axes real/cell.yaml --unattended", 3, "a person who holds the key"),
    ("axes ir361 --unattended --joint elbow", 2, "it has axis1, axis2, axis3"),
    ("jog real/cell.yaml", 3, "run the command in a terminal"),
    ("jog kr15 --home", 2, "has no home pose"),
    ("check real/cell.yaml", 4, "nocan9"),
    ("check nowhere", 2, "nowhere"),
    ("check real", 2, "is a folder; give real/cell.yaml"),
    ("record ir361 good.yaml --label latest", 2, "the newest run"),
    ("check ir361 --seconds 0", 2, "--seconds"),
    ("mock real/cell.yaml", 2, "simulated"),
    ("design ir361 -o good.yaml", 2, "exists already"),
    ("design ir361 -o new.yaml --period 9.999", 2, "whole number of cycles"),
    ("design ir361 -o missing/new.yaml", 7, "cannot be written"),
    ("design ir361 -o new.yaml --period 1e9", 2, "--period"),
    ("mock ir361 --log nowhere/bus.log", 7, "nowhere/bus.log: cannot be written"),
    ("init good.yaml/below", 7, "cannot make the folder"),
    ("import missing.csv --map ur10e_31", 2, "cannot read"),
    ("import binary.csv --map ur10e_31", 6, "wrong map or damaged file"),
    ("import text.csv --map ur10e_31", 6, "wrong map or damaged file"),
    ("import empty.csv --map ur10e_31", 6, "sound"),
    ("import text.csv --map ur10e", 2, "ur10e_31"),
    (
        "import text.csv --map good.yaml",
        2,
        "good.yaml: this is a motion file; give an import map file",
    ),
    ("import text.csv --map mine.map.yaml", 2, "two.yaml"),
    ("import text.csv --map ur10e_31 --rows 9-3", 2, "FIRST-LAST"),
    ("import text.csv --map ur10e_31 --rows x", 2, "FIRST-LAST"),
    ("average nope", 2, "rid-daq runs"),
    ("average nothing", 7, "no row was recorded"),
    ("identify nothing", 7, "no row was recorded"),
    ("identify nothing --band 0", 2, "--band"),
    ("identify text.csv", 2, "RID-RUN-IS-FILE"),
    (
        "validate nothing model.json",
        2,
        "then the run: rid-daq validate model.json nothing",
    ),
    ("validate missing.json nothing", 2, "missing.json"),
    ("validate model.json nothing", 2, "not an estimate"),
    ("validate good.yaml nothing", 2, "this is a motion file; give an estimate"),
    ("validate model.json moton.yaml --cell ir361", 2, "RID-FILE-READ"),
    ("report nothing", 7, "no result.json"),
    ("report spoilt", 7, "not valid JSON"),
    ("report real", 2, "no run"),
    ("demo --runs good.yaml", 7, "RID-FILE-WRITE"),
    ("demo --periods 1", 2, "--periods"),
]


@pytest.mark.parametrize(("words", "code", "expected_text"), TABLE, ids=[row[0] for row in TABLE])
def test_bad_input_gives_one_clear_message(
    words: str,
    code: int,
    expected_text: str,
    working_folder: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    capsys.readouterr()
    assert run(words.split()) == code
    message = capsys.readouterr().err
    assert expected_text in message
    assert "Traceback" not in message
    assert message.strip()


def test_a_runs_path_that_is_not_a_folder_is_refused_before_the_cell_starts(
    working_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[object] = []
    monkeypatch.setattr("rid_daq.recording.run_session.hold_reachable_cell", started.append)
    assert run(["record", "ir361", "good.yaml", "--runs", "good.yaml"]) == 7
    assert started == []


@pytest.mark.slow
def test_check_names_a_silent_node_and_a_deviating_gear(
    working_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    served = load_cell("ir361")
    assert served.plant is not None
    with SimulatedCell(
        CellSimulation(served.config, served.robot, served.plant, realtime=False, seed=0)
    ) as simulated:

        def check_with(change: Callable[[str], str], robot: Callable[[str], str] = str) -> int:
            run(["init", str(working_folder / "asked")])
            cell, description = (
                working_folder / "asked" / "cell.yaml",
                working_folder / "asked" / "robot.yaml",
            )
            channel = f"channel: {simulated.channel}"
            cell.write_text(change(cell.read_text().replace("channel: my_cell", channel)))
            description.write_text(robot(description.read_text()))
            code = run(["check", str(cell), "--seconds", "0.1"])
            for path in (working_folder / "asked").iterdir():
                path.unlink()
            return code

        assert check_with(lambda text: text.replace("node_id: 3", "node_id: 9")) == 4
        assert "RID-DRIVE-SILENT" in capsys.readouterr().err
        other_gear = check_with(str, lambda text: text.replace("ratio: 153.0", "ratio: 100.0"))
        assert other_gear == 3
        captured = capsys.readouterr()
        assert "RED     axis2, node 2: " in captured.out
        assert "  RED     6091h:00 gear ratio: 153:1, required 100\n" in captured.out
        assert "RID-PREFLIGHT-RED" in captured.err
