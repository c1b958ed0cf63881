"""Loop files and models that do not fit are refused, or reported with the affected results."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compensation.loops.loop_file import read_loops, write_loops
from compensation.loops.velocity_loop import VelocityLoop
from config.errors import ConfigError
from config.load import LoadedCell, load_cell
from identification.estimation.estimate import Estimate
from rid_daq.operations.cell_files import read_loops_for
from rid_daq.operations.path.model_doubts import model_doubts
from tests.builders.known_model import known_estimate
from tests.builders.raised_codes import raises_code

Edit = Callable[[dict[str, Any]], object]


@pytest.fixture(scope="module")
def cell() -> LoadedCell:
    return load_cell("ir361")


def loop(joint: str, p_value: float = 0.5, misfit: float = 0.0) -> VelocityLoop:
    fitted = VelocityLoop(joint, 500.0, 0.08, 0.0, 0.002, ("gain",), np.eye(1), p_value, ())
    return replace(fitted, misfit=misfit)


@pytest.fixture
def loops(cell: LoadedCell, tmp_path: Path) -> Path:
    made = [loop(joint) for joint in cell.robot.joint_names]
    write_loops(tmp_path / "loops.json", made, "ir361", "a run", "ir361")
    return tmp_path / "loops.json"


@pytest.mark.parametrize(
    ("edit", "place"),
    [
        (lambda d: d["loops"].append({**d["loops"][0], "gain": 1.0}), "loops.3.joint: axis1"),
        (lambda d: d["loops"][1].update(fitted=["gain", "gain"]), "loops.1.fitted: "),
        (lambda d: d["loops"][1].update(fitted=["stiffness"]), "loops.1.fitted: stiffness"),
        (lambda d: d["loops"][2].update(covariance=[[1.0, 0.0]]), "loops.2.covariance: "),
        (lambda d: d["loops"][0].update(covariance=[[-1.0]]), "loops.0.covariance: "),
        (lambda d: d["loops"][0].update(gain=500e3), "sha256: "),
        (lambda d: d["loops"][0].update(delay_s=0.5), "sha256: "),
        (lambda d: d.update(cell="kr15"), "sha256: "),
    ],
)
def test_an_edited_loop_file_is_refused_with_the_place(loops: Path, edit: Edit, place: str) -> None:
    document = json.loads(loops.read_text())
    edit(document)
    loops.write_text(json.dumps(document))
    with raises_code(ConfigError, "RID-LOOP-UNSOUND", f"{loops}: ", place):
        read_loops(loops)


def test_a_loop_of_a_joint_that_the_robot_does_not_have_is_refused(
    cell: LoadedCell, tmp_path: Path
) -> None:
    made = [loop(joint) for joint in (*cell.robot.joint_names, "axis4")]
    write_loops(tmp_path / "loops.json", made, "ir361", "a run")
    with raises_code(ConfigError, "RID-ROBOT-OTHER", "axis4"):
        read_loops_for(tmp_path / "loops.json", cell.robot, cell.config)


def test_loops_of_this_cell_are_not_doubted(cell: LoadedCell, loops: Path) -> None:
    assert read_loops_for(loops, cell.robot, cell.config).notes == ()


def test_loops_of_another_cell_with_the_same_robot_are_reported(loops: Path) -> None:
    other = load_cell("ir361_thesis")
    (note,) = read_loops_for(loops, other.robot, other.config).notes
    assert {"ir361,", "ir361_thesis"} <= set(note.split())


def test_a_loop_that_no_controller_explains_is_reported(cell: LoadedCell, tmp_path: Path) -> None:
    made = [loop("axis1"), loop("axis2", 1e-9, misfit=0.03), loop("axis3", 1e-9, misfit=0.005)]
    write_loops(tmp_path / "loops.json", made, "ir361", "a run", "ir361")
    (note,) = read_loops_for(tmp_path / "loops.json", cell.robot, cell.config).notes
    assert "axis2 (misfit 3 %, p = 1e-09)" in note
    assert "axis1" not in note
    assert "axis3" not in note, "a misfit of 0.5 % does not matter"


@pytest.fixture(scope="module")
def model(cell: LoadedCell) -> Estimate:
    found = known_estimate(cell, {})
    return replace(found, torque_nm=np.array([50.0, 50.0, 30.0]), residual_nm=np.full(3, 1.0))


def test_a_sound_model_is_not_doubted(model: Estimate, cell: LoadedCell) -> None:
    assert model_doubts(Path("model.json"), model, np.zeros((5, 3)), cell.config) == []


def test_a_joint_whose_torque_the_model_does_not_explain_is_named(
    model: Estimate, cell: LoadedCell
) -> None:
    bad = replace(model, residual_nm=np.array([1.0, 45.0, 1.0]))
    (note,) = model_doubts(Path("model.json"), bad, None, cell.config)
    assert "axis2" in note
