"""A model that `identify` rejected is refused by every command that computes with it."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from config.load import load_cell
from identification.estimation.estimate import Estimate
from identification.estimation.file import read_estimate, write_estimate
from rid_daq.app import run
from rid_daq.operations.catalogue import CATALOGUE, operation
from tests.builders.identified_run import arm_in_motion, identified_run
from tests.builders.json_output import document
from tests.builders.known_model import joint_path, known_estimate, write_path_files

REVERSED = "The torque of axis3 has the wrong sign."
COMMANDS = {
    "compensate": "compensate ir361 path.yaml --model MODEL --loop loops.json -o out.json",
    "retime": "retime ir361 path.yaml --model MODEL -o out.yaml",
    "stream": "stream ir361 path.yaml --model MODEL --loop loops.json --runs out",
    "record": "record ir361 path.yaml --model MODEL --runs out",
    "design": "design ir361 -o out.yaml --starts 1 --budget 1 --harmonics 2 --period 2"
    " --model MODEL",
    "given": "design ir361 -o out.yaml --starts 1 --budget 1 --harmonics 2 --period 2"
    " --given MODEL",
    "multisine": "design ir361 --kind multisine -o out.yaml --model MODEL",
    "export": "export MODEL --to python --as-identified -o out.py",
    "payload": "payload identify --loaded alone --model MODEL --runs runs -o out.json",
    "session": "payload ir361 --model MODEL --runs out",
    "sensitivity": "sensitivity ir361 --model MODEL",
    "calibrate": "calibrate poses ir361 --model MODEL -o out.csv",
}
JUDGES = {"compare", "friction", "validate"}
"""Commands that compare a model with data: a rejected model is their subject."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a motion, loops, a run, and sound and rejected models."""
    folder, sound = tmp_path_factory.mktemp("rejected"), known_estimate(load_cell("ir361"), {})
    write_path_files(folder, joint_path([0.0, 0.0, 0.0], [0.1, 0.1, 0.1]))
    write_estimate(folder / "contradicted.json", replace(sound, contradictions=(REVERSED,)))
    write_estimate(folder / "misfit.json", with_bad_fit(sound))
    arm = arm_in_motion()
    identified_run(folder / "runs", arm, "alone", 1)
    again = identified_run(folder / "runs", arm, "again", 2)
    write_estimate(folder / "sound.json", again)
    write_estimate(folder / "wrong.json", replace(again, contradictions=(REVERSED,)))
    return folder


def with_bad_fit(estimate: Estimate) -> Estimate:
    """Return an estimate that explains half of the torque of the second joint."""
    residual = np.where(np.arange(3) == 1, 0.5, 0.01) * 100.0
    return replace(estimate, torque_nm=np.full(3, 100.0), residual_nm=residual)


@pytest.mark.parametrize("model", ["contradicted", "misfit"])
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_refuses_a_rejected_model(
    folder: Path,
    command: str,
    model: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder)
    assert run(shlex.split(COMMANDS[command].replace("MODEL", f"{model}.json"))) == 6
    error = capsys.readouterr().err
    assert "RID-MODEL-MISFIT" in error
    assert ("axis3" if model == "contradicted" else "axis2") in error
    assert not [*folder.glob("out*")]


@pytest.mark.parametrize("command", ["compensate", "retime", "multisine"])
def test_a_rejected_model_is_used_on_request_with_a_note(
    folder: Path,
    command: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder)
    words = COMMANDS[command].replace("MODEL", "contradicted.json").replace("out.", f"{command}.")
    assert run([*words.split(), "--despite-misfit", "--json"]) == 0
    assert [note for note in document(capsys)["notes"] if REVERSED in note]


@pytest.mark.parametrize("command", ["compensate", "retime"])
def test_a_model_of_another_cell_is_used_with_a_note(
    folder: Path,
    command: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder)
    sound = known_estimate(load_cell("ir361"), {})
    for name, said in (("left_cell", 1), ("ir361", 0)):
        write_estimate(Path("cell.json"), replace(sound, cell_name=name))
        words = (
            COMMANDS[command].replace("MODEL", "cell.json").replace("out.", f"of_cell_{command}.")
        )
        assert run([*words.split(), "--overwrite", "--json"]) == 0
        assert len([note for note in document(capsys)["notes"] if "left_cell" in note]) == said


def test_a_rejected_model_fails_its_validation(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    for model, code in (("sound", 0), ("wrong", 1)):
        words = ["validate", f"{model}.json", "alone", "--limits", "20", "--runs", "runs"]
        assert run([*words, "--json"]) == code
        verdict = document(capsys)["verdict"]
        assert verdict["passed"] is (code == 0)
        assert all(check["passed"] for check in verdict["checks"])
        assert (REVERSED in verdict["sentence"]) is (code == 1)


def test_the_model_file_keeps_the_reasons(folder: Path) -> None:
    assert read_estimate(folder / "contradicted.json").objections == (REVERSED,)


def test_every_request_with_a_model_has_the_option() -> None:
    without = set()
    for name in CATALOGUE:
        fields = operation(name).request.model_fields
        if "model" not in fields or "despite_misfit" in fields:
            continue
        kinds = get_args(fields["model"].annotation) or (fields["model"].annotation,)
        if Path in kinds:
            without.add(name)
    assert without <= JUDGES
