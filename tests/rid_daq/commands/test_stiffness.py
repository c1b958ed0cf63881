"""Elastic gears from the recording to the corrected path, on a simulated cell with soft gears."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.runs.catalogue import find_run
from config.load import load_cell, load_robot, to_yaml
from identification.estimation.file import read_estimate
from identification.validation.torque_prediction import validate_torques
from rid_daq.app import run
from rid_daq.runs.run_data import RunData
from tests.builders.console_blocks import assert_shown
from tests.builders.screens import both_outputs

pytestmark = pytest.mark.slow

STIFFNESS, DAMPING = (5e4, 6e4, 2e4), (100.0, 110.0, 25.0)
"""Stiffness [N m/rad] and damping [N m s/rad] of the gears of the bundled plant."""
EXCITATION = "--period 9.6 --periods 4 --method two-harmonic --limit-fraction 0.85 --seed"
IDENTIFY = "rid-daq stiffness excitation-1 excitation-2 multisine"
BY_TRACKER = (
    "rid-daq stiffness excitation-1 excitation-2 multisine --tracker tracker-1.csv"
    " --tracker tracker-2.csv"
)
COMPENSATE = (
    "rid-daq compensate cell.yaml circle.yaml --model model.json --loop loops.json"
    " -o feedforward.json"
)
TRACK = "rid-daq tracking corrected --against rigid --model model.json"
MEASURE = "rid-daq tracking corrected --tracker corrected.csv"
CIRCLE = {
    "kind": "circle",
    "robot": "ir361",
    "centre_m": [0.575, -0.078, -1.724],
    "radius_m": 0.2,
    "speed_m_s": 0.6,
    "near": [0.1, -0.1, 0.4],
    "periods": 2,
}


def perform(words: str, *codes: int) -> None:
    """Run a command in the present folder."""
    assert run(words.removeprefix("rid-daq ").split()) in (codes or (0,)), words


def outputs(words: str, *codes: int) -> tuple[Any, str]:
    """Run a command in the present folder, and return its JSON document and its text."""
    return both_outputs(words.removeprefix("rid-daq ").split(), codes or (0,))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a cell whose gears are elastic, and runs for their identification."""
    folder, bundled = tmp_path_factory.mktemp("elastic"), load_cell("ir361_elastic")
    assert bundled.plant is not None
    (folder / "plant.yaml").write_text(to_yaml(bundled.plant))
    (folder / "robot.yaml").write_text(to_yaml(bundled.robot))
    cell = {"robot": "robot.yaml", "plant": "plant.yaml"}
    (folder / "cell.yaml").write_text(to_yaml(bundled.config.model_copy(update=cell)))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for number in (1, 2):
            perform(f"design cell.yaml -o excitation-{number}.yaml {EXCITATION} {number}")
            words = f"--label excitation-{number} --tracker tracker-{number}.csv"
            perform(f"record cell.yaml excitation-{number}.yaml {words}")
        perform(
            "design cell.yaml --kind multisine --band 0.5:30 --realisations 6 -o multisine.yaml"
        )
        perform("record cell.yaml multisine.yaml --label multisine")
    return folder


@pytest.fixture(scope="module")
def gears(folder: Path) -> tuple[Any, str]:
    """Return document and text of the identification from motors alone."""
    with contextlib.chdir(folder):
        return outputs(IDENTIFY)


@pytest.fixture(autouse=True)
def _in_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)


def test_the_stiffness_is_identified(gears: tuple[Any, str]) -> None:
    found, shown = gears
    for axis, stiffness, damping in zip(found["axes"], STIFFNESS, DAMPING, strict=True):
        assert axis["stiffness"] == pytest.approx(stiffness, rel=0.03)
        assert abs(axis["stiffness"] - stiffness) < 2.0 * axis["stiffness_std"]
        assert axis["damping"] == pytest.approx(damping, rel=0.2)
        assert axis["motor_inertia"] > 0.0
    assert_shown("elastic-gears", IDENTIFY, shown, same_numbers=False)


def test_the_plate_confirms_the_stiffness() -> None:
    found, _ = outputs(f"{IDENTIFY} --plate")
    assert found["has_plate"]
    assert [axis["stiffness"] for axis in found["axes"]] == pytest.approx(STIFFNESS, rel=0.03)


def test_a_tracker_confirms_the_stiffness() -> None:
    found, shown = outputs(BY_TRACKER)
    assert [axis["stiffness"] for axis in found["axes"]] == pytest.approx(STIFFNESS, rel=0.02)
    # The arm is off its nominal geometry; this is fitted too. The gears bend the tool by 2 mm.
    assert found["tool_residual_m"] < 1e-4
    assert_shown("elastic-gears", BY_TRACKER, shown, same_numbers=False)


def test_each_excitation_run_needs_its_own_file(capsys: pytest.CaptureFixture[str]) -> None:
    perform(f"{IDENTIFY} --tracker tracker-1.csv", 2)
    assert "RID-OPTION-COUNT" in capsys.readouterr().err
    perform(f"{IDENTIFY} --tracker tracker-2.csv --tracker tracker-1.csv", 6)
    assert "RID-TRACKER-ALIGNMENT" in capsys.readouterr().err


def test_encoders_that_contradict_the_motors_give_no_stiffness(folder: Path) -> None:
    names = [f"links-{number}.csv" for number in (1, 2)]
    for number, name in enumerate(names, start=1):
        data = RunData.load(find_run(Path("runs"), f"excitation-{number}"))
        recording = data.recording
        rows = [
            ",".join(map(str, row))
            for row in np.column_stack([recording.time_s, recording.position])
        ]
        (folder / name).write_text("\n".join(["time_s,axis1,axis2,axis3", *rows]))
    words = " ".join(f"--link-encoders {name}" for name in names)
    # These positions are those of the motors: they contradict the resonances.
    found, _ = outputs(f"{IDENTIFY} {words}", 6)
    assert found["has_link_encoders"]
    assert all(axis["stiffness"] is None for axis in found["axes"])
    assert found["robot_file"] == {}


def test_gears_need_a_stiffness_and_the_same_robot(capsys: pytest.CaptureFixture[str]) -> None:
    perform("identify excitation-1 --gears ir361 -o other.json", 2)
    assert "RID-OPTION-NO-EFFECT" in capsys.readouterr().err
    other = load_robot("kr15")
    stiff = tuple(joint.model_copy(update={"stiffness_nm_rad": 1e5}) for joint in other.joints)
    Path("other.yaml").write_text(to_yaml(other.model_copy(update={"joints": stiff})))
    perform("identify excitation-1 --gears other.yaml -o other.json", 2)
    assert "RID-ROBOT-OTHER" in capsys.readouterr().err


@pytest.mark.parametrize("runs", ["excitation-1 excitation-2", "multisine"])
def test_both_kinds_of_runs_are_needed(runs: str, capsys: pytest.CaptureFixture[str]) -> None:
    perform(f"stiffness {runs}", 2)
    assert "RID-STIFFNESS-RUNS" in capsys.readouterr().err


def test_the_corrected_path_moves_the_tool_as_planned(folder: Path, gears: tuple[Any, str]) -> None:
    keys = gears[0]["robot_file"]
    robot = load_cell("cell.yaml").robot
    joints = tuple(joint.model_copy(update=keys[joint.name]) for joint in robot.joints)
    (folder / "robot.yaml").write_text(to_yaml(robot.model_copy(update={"joints": joints})))
    (folder / "circle.yaml").write_text(json.dumps(CIRCLE))
    terms = "--friction-terms coulomb,viscous,presliding"
    perform(f"identify excitation-1 excitation-2 {terms} --gears robot.yaml -o model.json", 0, 6)
    model = read_estimate(Path("model.json"))
    assert model.robot.joints == joints
    assert model.gear_torque_nm is not None
    perform("loop multisine -o loops.json", 0, 6)
    perform(f"{COMPENSATE.replace('feedforward.json', 'rigid.json')} --no-deflection")
    perform("record cell.yaml circle.yaml --feedforward rigid.json --label rigid")
    _, shown = outputs(COMPENSATE)
    assert_shown("elastic-gears", COMPENSATE, shown, same_numbers=False)
    words = "--feedforward feedforward.json --label corrected --tracker corrected.csv"
    perform(f"record cell.yaml circle.yaml {words}")
    tracked, shown = outputs(TRACK)
    (motion,) = tracked["motions"]
    before, after = motion["against"]["bending"], motion["bending"]
    # The deflection changes the predicted torque; on this path by less than friction that the
    # model does not contain.
    judged = validate_torques(model, RunData.load(find_run(Path("runs"), "corrected")).recording)
    assert judged.gear_torque_nm is not None
    assert (judged.gear_torque_nm > 0.01).all()
    assert (judged.gear_torque_nm < judged.rms_nm).all()
    # The motors follow equally well; the deflection of some 2 mm is corrected at the tool.
    assert motion["mean_m"] < 1.5 * motion["against"]["mean_m"] < 1e-4
    assert before["tool_mean_m"] > 1e-3
    assert after["tool_mean_m"] < 0.1 * before["tool_mean_m"]
    assert_shown("elastic-gears", TRACK, shown, same_numbers=False)
    assert find_run(Path("runs"), "corrected").file("report.html").exists()
    measured, shown = outputs(MEASURE)
    (tool,) = measured["tool_side"]
    # The tracker's noise is 0.08 mm of it; the kinematics of the robot file are wrong by more.
    assert tool["mean_m"] < 0.4e-3
    assert_shown("elastic-gears", MEASURE, shown, same_numbers=False)
