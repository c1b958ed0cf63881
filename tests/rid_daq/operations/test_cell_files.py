"""Files that are given together with a cell must belong to its robot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.motion.kinds.multipoint import MultipointMotion
from compensation.loops.loop_file import write_loops
from compensation.loops.velocity_loop import VelocityLoop
from config.errors import ConfigError
from config.load import LoadedCell, load_cell, load_robot, to_yaml
from identification.estimation.file import write_estimate
from rid_daq.app import run
from rid_daq.operations.cell_files import read_estimate_for, read_motion_and_bytes, read_motion_for
from tests.builders.known_model import known_estimate
from tests.builders.raised_codes import raises_code


@pytest.fixture
def cell() -> LoadedCell:
    return load_cell("ir361")


def velocity_loops(cell: LoadedCell) -> list[VelocityLoop]:
    return [
        VelocityLoop(joint, 500.0, 0.08, 0.0, 0.002, ("gain",), np.eye(1), 1.0, ())
        for joint in cell.robot.joint_names
    ]


def write_motion(folder: Path, robot: str) -> Path:
    motion = MultipointMotion(kind="multipoint", robot=robot, points=3, seed=1)
    path = folder / "motion.yaml"
    path.write_text(f"# kept as it stands\n{to_yaml(motion)}")
    return path


def test_the_motion_file_is_returned_with_its_unchanged_bytes(
    cell: LoadedCell, tmp_path: Path
) -> None:
    path = write_motion(tmp_path, cell.robot.name)
    motion, kept = read_motion_and_bytes(path, cell)
    assert motion.robot == cell.robot.name
    assert kept == path.read_bytes()


def test_a_motion_of_another_robot_is_refused_with_both_names(
    cell: LoadedCell, tmp_path: Path
) -> None:
    path = write_motion(tmp_path, "another")
    with pytest.raises(ConfigError) as refused:
        read_motion_for(path, cell)
    for word in (str(path), "'another'", repr(cell.robot.name), cell.config.name):
        assert word in str(refused.value)


def test_a_model_of_the_cells_robot_may_have_other_limits_and_friction(
    cell: LoadedCell, tmp_path: Path
) -> None:
    write_estimate(tmp_path / "model.json", known_estimate(cell, {}))
    text = cell.files["robot.yaml"].decode().replace("velocity: 2.6", "velocity: 2.0")
    (tmp_path / "robot.yaml").write_text(text.replace("[coulomb, viscous]", "[coulomb, cubic]"))
    robot = load_robot(str(tmp_path / "robot.yaml"))
    found = read_estimate_for(tmp_path / "model.json", robot, despite_misfit=False)
    assert found.robot == cell.robot


@pytest.mark.parametrize(
    ("right", "wrong", "key"),
    [
        ("a_m: 0.480", "a_m: 0.580", "kinematics"),
        ("gear_ratio: 153.0", "gear_ratio: 100.0", "joints.1.gear_ratio"),
        ("0.0, 9.81]", "0.0, -9.81]", "gravity_m_s2"),
        ("name: ir361", "name: ir362", "name"),
        ("r_m: 0.100", "r_m: 0.110", "spring"),
    ],
)
def test_a_model_of_another_robot_is_refused_with_the_differences(
    cell: LoadedCell, tmp_path: Path, right: str, wrong: str, key: str
) -> None:
    write_estimate(tmp_path / "model.json", known_estimate(cell, {}))
    (tmp_path / "robot.yaml").write_text(cell.files["robot.yaml"].decode().replace(right, wrong))
    robot = load_robot(str(tmp_path / "robot.yaml"))
    with raises_code(ConfigError, "RID-ROBOT-OTHER", f" {key}. "):
        read_estimate_for(tmp_path / "model.json", robot, despite_misfit=False)


def test_a_difference_of_several_joints_is_reported_once(cell: LoadedCell) -> None:
    robot = cell.robot
    renamed = [joint.model_copy(update={"name": f"j{n}"}) for n, joint in enumerate(robot.joints)]
    renamed[1:] = [each.model_copy(update={"gear_ratio": 9.0}) for each in renamed[1:]]
    other = robot.model_copy(update={"joints": tuple(renamed)})
    assert robot.differences(other) == ("name of all joints", "gear_ratio of axis2, axis3")


@pytest.mark.parametrize("command", ["design", "compensate", "stream", "record"])
def test_every_command_with_a_cell_compares_the_model_with_its_robot(
    command: str, cell: LoadedCell, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["init", str(tmp_path / "cell")]) == 0
    robot, mine = tmp_path / "cell" / "robot.yaml", str(tmp_path / "cell" / "cell.yaml")
    robot.write_text(robot.read_text().replace("name: my_robot", "name: ir361"))
    model, loops = tmp_path / "model.json", tmp_path / "loops.json"
    write_estimate(model, known_estimate(load_cell(mine), {}))
    robot.write_text(robot.read_text().replace("a_m: 0.480", "a_m: 0.580"))
    motion = write_motion(tmp_path, "ir361")
    write_loops(loops, velocity_loops(cell), "ir361", "a run")
    words = {
        "design": ["-o", str(tmp_path / "new.yaml")],
        "compensate": [str(motion), "--loop", str(loops), "-o", str(tmp_path / "new.json")],
        "stream": [str(motion), "--loop", str(loops)],
        "record": [str(motion)],
    }[command]
    assert run([command, mine, *words, "--model", str(model)]) == 2
    assert "RID-ROBOT-OTHER" in capsys.readouterr().err


@pytest.mark.slow
def test_refine_and_payload_compare_the_model_with_the_robot(
    cell: LoadedCell, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arm = cell.config.model_copy(update={"plate": None})
    (tmp_path / "cell.yaml").write_text(to_yaml(arm))
    mine, runs = str(tmp_path / "cell.yaml"), ["--runs", str(tmp_path / "runs")]
    motion = write_motion(tmp_path, "ir361")
    assert run(["record", mine, str(motion), "--label", "driven", *runs]) == 0
    row = cell.robot.kinematics.rows[-1].model_copy(update={"a_m": 0.58})
    longer = cell.robot.kinematics.model_copy(
        update={"rows": (*cell.robot.kinematics.rows[:-1], row)}
    )
    other = cell.robot.model_copy(update={"kinematics": longer})
    model, loops = tmp_path / "model.json", tmp_path / "loops.json"
    write_estimate(model, known_estimate(replace(cell, robot=other), {}))
    write_loops(loops, velocity_loops(cell), "ir361", "a run")
    new = ["-o", str(tmp_path / "new.json")]
    made = sorted((tmp_path / "runs").iterdir())
    for words in (
        ["refine", "driven", "--loop", str(loops), *new, *runs],
        ["payload", mine, "--yes", *runs],
    ):
        assert run([*words, "--model", str(model)]) == 2
        assert "RID-ROBOT-OTHER" in capsys.readouterr().err
    assert sorted((tmp_path / "runs").iterdir()) == made  # no motion was recorded
