"""Commands with a model of links behind elastic gears that compute with rigid gears say so."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.load import load_cell, to_yaml
from identification.estimation.file import write_estimate
from tests.builders.elastic_model import links_model
from tests.builders.known_model import joint_path, write_path_files
from tests.builders.screens import both_outputs

pytestmark = pytest.mark.usefixtures("plain_reports")

CODE = "RID-MODEL-RIGID-GEARS"
COMMANDS = {
    "stream": "stream ir361 path.yaml --model MODEL --loop loops.json --seed 1",
    "retime": "retime ir361 path.yaml --model MODEL -o fast.yaml --overwrite",
    "design": "design ir361 -o motion.yaml --model MODEL --starts 1 --budget 1 --harmonics 2"
    " --period 2",
    "export": "export MODEL --to python --as-identified -o torque.py --overwrite",
    "compensate": "compensate ir361 path.yaml --model MODEL --loop loops.json -o ahead.json"
    " --overwrite",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a motion file, velocity loops, and models of motors and links."""
    folder, cell = tmp_path_factory.mktemp("rigid"), load_cell("ir361")
    write_path_files(folder, joint_path([0.0, 0.0, 0.0], [0.1, 0.1, 0.1]))
    write_estimate(folder / "links.json", links_model(cell))
    return folder


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_says_that_it_computes_with_rigid_gears(
    folder: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    document, shown = both_outputs(COMMANDS[command].replace("MODEL", "links.json").split())
    (note,) = [note for note in document["notes"] if CODE in note]
    assert "axis1 0.5 N m" in note
    assert CODE in shown


@pytest.mark.parametrize("command", ["retime", "compensate", "export"])
def test_a_model_that_was_fitted_to_the_motors_needs_no_note(
    folder: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    document, shown = both_outputs(COMMANDS[command].replace("MODEL", "alone.json").split())
    assert CODE not in f"{document['notes']}{shown}"


def test_stream_says_that_a_stated_stiffness_has_no_effect(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    loaded = load_cell("ir361")
    soft = tuple(
        joint.model_copy(update={"stiffness_nm_rad": 5e4}) for joint in loaded.robot.joints
    )
    Path("soft.yaml").write_text(to_yaml(loaded.robot.model_copy(update={"joints": soft})))
    config = loaded.config.model_copy(update={"robot": str(folder / "soft.yaml")})
    Path("cell.yaml").write_text(to_yaml(config))
    words = COMMANDS["stream"].replace("MODEL", "alone.json").replace("ir361", "cell.yaml")
    document, shown = both_outputs(words.split())
    (note,) = [note for note in document["notes"] if CODE in note]
    assert "stiffness_nm_rad" in note
    assert CODE in shown


def test_without_correction_on_request_nothing_is_said(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    words = f"{COMMANDS['compensate'].replace('MODEL', 'links.json')} --no-deflection"
    document, shown = both_outputs(words.split())
    assert CODE not in f"{document['notes']}{shown}"
