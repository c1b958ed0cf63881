"""The last pose of a cell in this account's state folder: stored, compared, accepted."""

from __future__ import annotations

import math
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import pytest

from acquisition.motion.known_pose import MOVED
from config.errors import RidDaqError
from config.load import LoadedCell, load_cell
from rid_daq.preflight.check_words import show_devices
from rid_daq.preflight.last_pose import LAST_POSE, PoseRule, known_pose, pose_lines, store_pose
from rid_daq.terminal.console import Console
from tests.builders.console_blocks import assert_shown

HERE, ELSEWHERE = [0.1, 0.2, 0.3], [0.1, 0.2, 0.5]


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "rid-daq" / "last-poses"


@pytest.fixture
def real_cell(state: Path, tmp_path: Path) -> LoadedCell:
    loaded = load_cell("ir361")
    config = loaded.config.model_copy(update={"simulated": False})
    return replace(loaded, config=config, path=tmp_path / "cell.yaml")


def verdict(loaded: LoadedCell, position: list[float], rule: PoseRule = PoseRule.COMPARED) -> str:
    (line,) = pose_lines(loaded, position, rule)
    assert line.what == LAST_POSE
    assert (line.code == MOVED) is (line.verdict == "red")
    return line.verdict


def test_the_first_check_stores_the_pose_and_later_checks_compare_it(real_cell: LoadedCell) -> None:
    assert verdict(real_cell, HERE) == "shown"
    assert verdict(real_cell, HERE) == "ok"
    assert verdict(real_cell, ELSEWHERE) == "red"
    assert verdict(real_cell, ELSEWHERE) == "red", "a red check does not store the pose"


def test_the_first_check_prints_the_pose_as_not_verified(real_cell: LoadedCell) -> None:
    (line,) = pose_lines(real_cell, HERE, PoseRule.COMPARED)
    assert all(text in line.found for text in ("axis1 5.7°", "axis2 11.5°", "axis3 17.2°"))
    (again,) = pose_lines(real_cell, HERE, PoseRule.COMPARED)
    assert (line.verdict, again.verdict) == ("shown", "ok")


def test_an_accepted_pose_replaces_the_stored_one(real_cell: LoadedCell) -> None:
    store_pose(real_cell, HERE, "run A")
    assert verdict(real_cell, ELSEWHERE, PoseRule.ACCEPTED) == "allowed"
    assert verdict(real_cell, ELSEWHERE) == "ok"
    assert verdict(real_cell, HERE) == "red"


def test_a_lost_turn_of_the_motor_is_named(
    real_cell: LoadedCell, capsys: pytest.CaptureFixture[str]
) -> None:
    store_pose(real_cell, HERE, "run 01M8FBPNY744RHWHGCP4CFPHBD")
    turned = [HERE[0], HERE[1] + 2.0 * math.pi / real_cell.robot.joints[1].gear_ratio, HERE[2]]
    show_devices(Console(), pose_lines(real_cell, turned, PoseRule.COMPARED))
    assert_shown("when-it-stops", "rid-daq check CELL", capsys.readouterr().out)


def test_another_pose_of_a_served_simulated_cell_is_allowed(real_cell: LoadedCell) -> None:
    config = real_cell.config.model_copy(update={"simulated": True})
    simulated = replace(real_cell, config=config)
    store_pose(simulated, HERE, "run A")
    assert verdict(simulated, ELSEWHERE) == "allowed"


def test_a_simulated_cell_started_by_the_command_has_no_stored_pose(
    real_cell: LoadedCell, state: Path
) -> None:
    assert pose_lines(real_cell, HERE, PoseRule.LEFT_OUT) == []
    assert not state.exists()


def test_each_cell_file_has_a_separate_pose(real_cell: LoadedCell, tmp_path: Path) -> None:
    store_pose(real_cell, HERE, "run A")
    assert known_pose(replace(real_cell, path=tmp_path / "other.yaml"), binding=True) is None
    linked = tmp_path / "linked.yaml"
    linked.symlink_to(tmp_path / "cell.yaml")
    assert known_pose(replace(real_cell, path=linked), binding=True) is not None


def test_a_stored_pose_of_other_joints_is_ignored(real_cell: LoadedCell) -> None:
    store_pose(real_cell, HERE, "run A")
    joints = tuple(
        joint.model_copy(update={"name": f"{joint.name}b"}) for joint in real_cell.robot.joints
    )
    renamed = replace(real_cell, robot=real_cell.robot.model_copy(update={"joints": joints}))
    assert known_pose(renamed, binding=True) is None


def test_the_cell_page_finds_the_line_by_its_code() -> None:
    script = files("rid_daq.workbench").joinpath("static/cell.js").read_text(encoding="utf-8")
    assert f'"{MOVED}"' in script


@pytest.mark.parametrize("content", ["", "{", '{"cell": 3}', '{"position": [NaN]}'])
def test_a_damaged_file_is_refused(real_cell: LoadedCell, state: Path, content: str) -> None:
    store_pose(real_cell, HERE, "run A")
    (file,) = state.iterdir()
    file.write_text(content)
    with pytest.raises(RidDaqError) as caught:
        known_pose(real_cell, binding=True)
    assert str(file) in str(caught.value)
