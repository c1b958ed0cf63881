"""`rid-daq import FILE --robot ROBOT`: the program proposes an import map, a person confirms it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from acquisition.runs.folder import RunFolder
from config.load import to_yaml
from rid_daq.app import run
from rid_daq.runs.run_data import RunData
from tests.builders.console_blocks import assert_shown
from tests.builders.foreign_tables import as_lines, sound_table, two_joint_robot

NAMES = "t,pos_a,pos_b,vel_a,vel_b,torque_a,torque_b"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a working folder with a robot file and a recording of this robot."""
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "arm.yaml").write_text(to_yaml(two_joint_robot()))
    (tmp_path / "rec.csv").write_text("\n".join([NAMES, *as_lines(sound_table())]))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refusal(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    capsys.readouterr()
    assert run([*words, "--json"]) != 0
    code: str = json.loads(capsys.readouterr().out)["error"]["code"]
    return code


def test_the_proposed_map_imports_the_recording(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "maps").mkdir()
    words = ["import", "rec.csv", "--robot", "robots/arm.yaml", "--proposal", "maps/arm.yaml"]
    assert run([*words, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["map"] == "maps/arm.yaml"
    assert document["can_be_imported"]
    assert document["keys"]["joints"][1]["torque"] == "torque_b"
    assert run(["import", "rec.csv", "--map", "maps/arm.yaml", "--runs", "runs", "--json"]) == 0
    run_folder = Path(json.loads(capsys.readouterr().out)["folder"])
    recording = RunData.load(RunFolder.open(run_folder)).recording
    assert recording.joint_names == ("a", "b")
    assert recording.torque_nm[:, 1] == pytest.approx(sound_table()[:, 6], abs=1e-6)


def test_the_terminal_shows_reasons_doubts_and_the_next_command(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["import", "rec.csv", "--robot", "robots/arm.yaml"]) == 0
    out = capsys.readouterr().out
    assert "pos_a to pos_b" in out
    assert "Check: torque" in out
    assert "rid-daq import rec.csv --map rec.map.yaml" in out
    text = (folder / "rec.map.yaml").read_text()
    assert "# position: columns pos_a to pos_b" in text
    assert 'robot: "robots/arm.yaml"' in text


def test_the_guide_shows_a_proposal(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = "rid-daq import rec.csv --robot robots/arm.yaml"
    assert run(command.split()[1:]) == 0
    assert_shown("someone-elses-recording", command, capsys.readouterr().out)


def test_an_existing_map_is_not_replaced(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "rec.map.yaml").write_text("mine")
    words = ["import", "rec.csv", "--robot", "robots/arm.yaml"]
    assert refusal(words, capsys) == "RID-FILE-EXISTS"
    assert (folder / "rec.map.yaml").read_text() == "mine"


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ([], "RID-OPTION-NEEDS"),
        (["--robot", "robots/arm.yaml", "--map", "ur10e_31"], "RID-OPTION-NO-EFFECT"),
        (["--robot", "robots/arm.yaml", "--rows", "1-200"], "RID-OPTION-NO-EFFECT"),
        (["--map", "ur10e_31", "--proposal", "m.yaml"], "RID-REQUEST-INVALID"),
        (["rec.csv", "--robot", "robots/arm.yaml"], "RID-IMPORT-FILES"),
        (["--robot", "ir361"], "RID-IMPORT-PROPOSAL"),
        (["--robot", "robots/none.yaml"], "RID-FILE-READ"),
    ],
)
def test_contradictory_options_are_refused(
    options: list[str], code: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert refusal(["import", "rec.csv", *options], capsys) == code
    assert not list(folder.glob("*.map.yaml"))
