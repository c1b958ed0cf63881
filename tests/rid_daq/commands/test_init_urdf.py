"""`rid-daq init --urdf`: a URDF becomes a working simulated cell.

Links without a mass in the URDF are simulated as cylinders.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TypeVar

import numpy as np
import pinocchio as pin
import pytest
from pydantic import BaseModel

from acquisition.motion.motion_file import load_motion
from config.load import load_cell
from mock_hw.plant.plant import Plant
from mock_hw.plant.rigid_bodies import build_rigid_bodies
from rid_daq.app import run
from tests.builders.mesh_files import binary_stl, box, write

T = TypeVar("T", bound=BaseModel)

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


def _set(model: T, **values: object) -> T:
    return model.model_copy(update=values)


def test_init_makes_a_simulated_cell_from_a_urdf(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "two.urdf").write_text(urdf())
    words = [
        "init",
        str(tmp_path / "cell"),
        "--no-rehearsal",
        "--urdf",
        str(tmp_path / "two.urdf"),
        "--tip",
        "hand",
    ]
    assert run([*words, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert sorted(result["files"]) == [
        *("cell.yaml", "plant.yaml", "robot.png", "robot.yaml", "validation.yaml"),
    ]
    assert any("1 rounded angles were" in note for note in result["notes"])

    loaded = load_cell(str(tmp_path / "cell" / "cell.yaml"))
    assert loaded.config.simulated
    assert loaded.robot.tool_offset_m == pytest.approx((0.3, 0.0, 0.0))
    motion = load_motion(tmp_path / "cell" / "validation.yaml")
    motion.plan(loaded.robot, loaded.config.cycle_time_s)


def test_the_simulated_links_equal_those_of_the_urdf(tmp_path: Path) -> None:
    (tmp_path / "two.urdf").write_text(urdf().replace("1.5708", "1.5707963267948966"))
    assert (
        run(
            ["init", str(tmp_path / "cell"), "--no-rehearsal", "--urdf", str(tmp_path / "two.urdf")]
        )
        == 0
    )
    loaded = load_cell(str(tmp_path / "cell" / "cell.yaml"))
    assert loaded.plant is not None
    plant = Plant(loaded.robot, loaded.plant, seed=0)
    assert (
        plant.position > 0.5
    ).all()  # zero is outside the limits, so the joints start in the middle
    robot = loaded.robot.model_copy(
        update={"joints": tuple(_set(joint, armature=False) for joint in loaded.robot.joints)}
    )
    links = loaded.plant.model_copy(
        update={"axes": tuple(_set(axis, rotor_inertia_kg_m2=0.0) for axis in loaded.plant.axes)}
    )
    simulated = build_rigid_bodies(robot, links).model
    judge = pin.buildModelFromXML(urdf().replace("1.5708", "1.5707963267948966"))
    for sample in np.random.default_rng(0).uniform(-2, 2, (5, 3, 2)):
        expected = pin.rnea(judge, judge.createData(), *sample)
        tau = pin.rnea(simulated, simulated.createData(), *sample)
        np.testing.assert_allclose(tau, expected, atol=1e-9)


def test_links_without_masses_are_simulated_as_cylinders_with_a_note(tmp_path: Path) -> None:
    (tmp_path / "two.urdf").write_text(urdf(masses=False))
    assert (
        run(
            ["init", str(tmp_path / "cell"), "--no-rehearsal", "--urdf", str(tmp_path / "two.urdf")]
        )
        == 0
    )
    loaded = load_cell(str(tmp_path / "cell" / "cell.yaml"))
    assert loaded.config.simulated
    assert not loaded.robot.is_drawn
    text = " ".join((tmp_path / "cell" / "robot.yaml").read_text().replace("#", "").split())
    assert "a guess, because the URDF states no mass: a cylinder of" in text


def test_missing_limits_of_a_urdf_come_from_options_and_are_marked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "two.urdf").write_text(urdf().replace('effort="50"', 'effort="0"'))
    words = [
        "init",
        str(tmp_path / "cell"),
        "--no-rehearsal",
        "--urdf",
        str(tmp_path / "two.urdf"),
        "--json",
    ]
    assert run([*words, "--effort", "800,600", "--acceleration", "4"]) == 0
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert "torque of lift, bend: 800, 600 (--effort: the URDF states 0)" in notes
    joints = load_cell(str(tmp_path / "cell" / "cell.yaml")).robot.joints
    assert [joint.limits.torque for joint in joints] == [800.0, 600.0]
    assert [joint.limits.acceleration for joint in joints] == [4.0, 4.0]
    assert all(joint.armature for joint in joints)
    assert {joint.friction for joint in joints} == {("coulomb", "viscous", "offset")}
    lines = (tmp_path / "cell" / "robot.yaml").read_text().splitlines()
    at = lines.index("- name: bend")
    assert lines[at - 1] == "# torque: 600 (--effort: the URDF states 0)"


def test_all_problems_of_a_urdf_are_reported_together(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = (
        urdf()
        .replace('<parent link="fore"/>', '<parent link="arm"/>')
        .replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', 1)
        .replace('<mass value="3"/>', '<mass value="three"/>')
        .replace('<link name="hand"/>', '<link name="hand"/><link name="base"/>')
    )
    (tmp_path / "two.urdf").write_text(broken)
    assert (
        run(
            ["init", str(tmp_path / "cell"), "--no-rehearsal", "--urdf", str(tmp_path / "two.urdf")]
        )
        == 2
    )
    output = capsys.readouterr().err
    assert "value of <mass> is 'three', not 1 number within" in output
    assert "two.urdf:3: the joint's axis has no direction" in output
    assert "a second link is named 'base'" in output
    assert "joint 'mount' refers to a missing link 'arm'; add it, or remove the joint" in output


def test_a_urdf_of_several_arms_is_refused_with_a_command_for_each(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = urdf()
    for name in ("upper", "fore", "hand", "lift", "bend", "mount"):
        other = other.replace(f'"{name}"', f'"other_{name}"')
    inner = other.split('<link name="base"/>')[1]
    (tmp_path / "two.urdf").write_text(urdf().replace("</robot>", inner))
    words = ["init", "cell", "--urdf", str(tmp_path / "two.urdf")]
    assert run(words) == 2
    output = capsys.readouterr().err
    for tip in ("fore", "other_fore"):
        assert f"rid-daq {' '.join(words)} --tip {tip}  (2 joints)" in output


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--urdf", "{}/none.urdf"], "none.urdf: the file cannot be read: No such file"),
        (["--urdf", "{}/two.urdf", "--base", "leg"], "no link is named 'leg'; links are base,"),
        (["--urdf", "{}/two.urdf", "--base", "fore", "--tip", "base"], "is not below 'fore'"),
        (["--tip", "hand"], "--tip: has no effect without --urdf"),
        (["--urdf", "{}/two.urdf", "--effort", "1,2,3"], "--effort has 3 values; give one, or one"),
        (["--urdf", "{}/two.urdf", "--range", "-1"], "RID-OPTION-RANGE"),
        (["--urdf", "{}/two.urdf", "--range", "wide"], "RID-OPTION-SYNTAX"),
    ],
)
def test_invalid_options_are_refused_and_no_file_is_written(
    words: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "two.urdf").write_text(urdf())
    assert run(["init", str(tmp_path / "cell"), *(w.format(tmp_path) for w in words)]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "cell").exists()


def test_an_unreadable_limit_gives_exit_code_2_and_no_file_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "two.urdf").write_text(urdf().replace('upper="2"', 'upper="2,0"'))
    folder = tmp_path / "cell"
    words = ["init", str(folder), "--no-rehearsal", "--urdf", str(tmp_path / "two.urdf")]
    assert run(words) == 2
    assert "RID-FILE-NUMBER" in capsys.readouterr().err
    assert not folder.exists()


def test_the_simulated_cell_has_the_friction_and_directions_of_the_urdf(tmp_path: Path) -> None:
    motor = (
        '<dynamics damping="1.5" friction="2.5"/></joint><transmission name="t">'
        '<joint name="lift"/><actuator name="m"><mechanicalReduction>-50</mechanicalReduction>'
        "</actuator></transmission>"
    )
    (tmp_path / "two.urdf").write_text(urdf().replace("</joint>", motor, 1))
    folder = tmp_path / "cell"
    assert run(["init", str(folder), "--no-rehearsal", "--urdf", str(tmp_path / "two.urdf")]) == 0
    loaded = load_cell(str(folder / "cell.yaml"))
    assert loaded.plant is not None
    axis = loaded.plant.axes[0]
    assert (axis.coulomb_nm, axis.viscous_nm_s) == (2.5, 1.5)
    assert [each.direction for each in loaded.config.axes] == [-1, 1]
    assert loaded.robot.joints[0].gear_ratio == 50.0


def test_meshes_of_the_named_packages_become_bodies(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(
        tmp_path / "packages/two/fore.stl", binary_stl(*box((0, -0.05, -0.05), (0.3, 0.05, 0.05)))
    )
    shape = '<collision><geometry><mesh filename="package://two/fore.stl"/></geometry></collision>'
    text = urdf().replace('<link name="fore">', f'<link name="fore">{shape}')
    write(tmp_path / "robot/two.urdf", text)
    words = ["init", "--no-rehearsal", "--json", "--urdf", str(tmp_path / "robot/two.urdf")]
    assert run([*words, str(tmp_path / "cell"), "--packages", str(tmp_path / "packages")]) == 0
    assert any("fore 1, 8 points" in note for note in json.loads(capsys.readouterr().out)["notes"])
    bodies = load_cell(str(tmp_path / "cell" / "cell.yaml")).robot.bodies
    assert [(body.link, body.name) for body in bodies] == [(2, "fore")]

    assert run([*words, str(tmp_path / "other")]) == 0
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert any("'two'" in note and "--packages" in note for note in notes)
    assert load_cell(str(tmp_path / "other" / "cell.yaml")).robot.bodies == ()
