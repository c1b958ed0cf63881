"""`rid-daq init --urdf`: a URDF becomes a cell that runs, simulated where its masses are known."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from acquisition.motion.motion_file import load_motion
from config.load import load_cell
from mock_hw.plant.plant import Plant
from mock_hw.plant.rigid_bodies import build_rigid_bodies
from rid_daq.app import run

LIMIT = '<limit lower="0.5" upper="2" effort="50" velocity="2"/>'
LINK = (
    '<link name="{}"><inertial><origin xyz="0.1 0.02 0" rpy="0 0.3 0"/><mass value="{}"/>'
    '<inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0.01" ixz="0" iyz="0"/></inertial></link>'
)


def urdf(masses: bool = True) -> str:
    upper, fore = (
        LINK.format(name, 3 + i) if masses else f'<link name="{name}"/>'
        for i, name in enumerate(("upper", "fore"))
    )
    return f"""
    <robot name="two"><link name="base"/>{upper}{fore}<link name="hand"/>
    <joint name="lift" type="revolute"><parent link="base"/><child link="upper"/>
      <origin xyz="0 0.1 0.5" rpy="1.5708 0 0"/><axis xyz="0 0 1"/>{LIMIT}</joint>
    <joint name="bend" type="revolute"><parent link="upper"/><child link="fore"/>
      <origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>{LIMIT}</joint>
    <joint name="mount" type="fixed"><parent link="fore"/><child link="hand"/>
      <origin xyz="0.3 0 0"/></joint></robot>"""


def test_a_urdf_becomes_a_simulated_cell(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "two.urdf").write_text(urdf())
    words = ["init", str(tmp_path / "cell"), "--urdf", str(tmp_path / "two.urdf"), "--tip", "hand"]
    assert run([*words, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert sorted(said["files"]) == ["cell.yaml", "plant.yaml", "robot.yaml", "validation.yaml"]
    assert any("1 angles within" in note for note in said["notes"])

    loaded = load_cell(str(tmp_path / "cell" / "cell.yaml"))
    assert loaded.config.simulated
    assert loaded.robot.tool_offset_m == pytest.approx((0.3, 0.0, 0.0))
    motion = load_motion(tmp_path / "cell" / "validation.yaml")
    motion.plan(loaded.robot, loaded.config.cycle_time_s)


def test_the_simulated_links_are_the_urdfs(tmp_path: Path) -> None:
    (tmp_path / "two.urdf").write_text(urdf().replace("1.5708", "1.5707963267948966"))
    assert run(["init", str(tmp_path / "cell"), "--urdf", str(tmp_path / "two.urdf")]) == 0
    loaded = load_cell(str(tmp_path / "cell" / "cell.yaml"))
    assert loaded.plant is not None
    plant = Plant(loaded.robot, loaded.plant, seed=0)
    assert (plant.position > 0.5).all()  # zero is outside the limits: they start in the middle
    simulated = build_rigid_bodies(loaded.robot, loaded.plant).model
    judge = pin.buildModelFromXML(urdf().replace("1.5708", "1.5707963267948966"))
    for sample in np.random.default_rng(0).uniform(-2, 2, (5, 3, 2)):
        expected = pin.rnea(judge, judge.createData(), *sample)
        tau = pin.rnea(simulated, simulated.createData(), *sample)
        np.testing.assert_allclose(tau, expected, atol=1e-9)


def test_without_masses_the_cell_is_for_real_drives(tmp_path: Path) -> None:
    (tmp_path / "two.urdf").write_text(urdf(masses=False))
    assert run(["init", str(tmp_path / "cell"), "--urdf", str(tmp_path / "two.urdf")]) == 0
    loaded = load_cell(str(tmp_path / "cell" / "cell.yaml"))
    assert not loaded.config.simulated
    assert loaded.robot.cad is None
    assert "has no mass" in (tmp_path / "cell" / "robot.yaml").read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--urdf", "{}/none.urdf"], "none.urdf: cannot read: No such file"),
        (["--urdf", "{}/two.urdf", "--base", "leg"], "there is no link 'leg'; links are base,"),
        (["--urdf", "{}/two.urdf", "--base", "fore", "--tip", "base"], "does not hang on 'fore'"),
        (["--tip", "hand"], "give it with --urdf"),
    ],
)
def test_what_cannot_be_made_is_said_and_nothing_written(
    words: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "two.urdf").write_text(urdf())
    assert run(["init", str(tmp_path / "cell"), *(w.format(tmp_path) for w in words)]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "cell").exists()
