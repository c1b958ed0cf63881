"""A user's URDF with identified inertias is checked by Pinocchio, MuJoCo and urdfdom."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from config.errors import ConfigError, EstimationError
from config.formats.urdf_file import read_urdf
from config.robot.kinematic_table import KinematicRow, Kinematics
from identification.consistency.closest_robot import ConsistentEstimate, find_closest
from identification.export.model import ExportModel
from identification.export.urdf_update import UpdatedUrdf, UrdfUpdate
from tests.builders.identified_urdf import (
    DAMPING,
    FRICTION,
    IdentifiedUrdf,
    arm_of,
    identified_urdf,
    random_motion,
    rnea,
)
from tests.builders.raised_codes import raises_code

ARM = (Path(__file__).parent / "arm.urdf").read_bytes().replace(b"\n", b"\r\n")


@pytest.fixture(scope="module")
def made() -> IdentifiedUrdf:
    return identified_urdf(ARM, "hand")


@pytest.fixture(scope="module")
def update(made: IdentifiedUrdf) -> UrdfUpdate:
    return UrdfUpdate(ARM, "arm.urdf", ExportModel.from_estimate(made.estimate))


@pytest.fixture(scope="module")
def found(made: IdentifiedUrdf, update: UrdfUpdate) -> ConsistentEstimate:
    return find_closest(made.estimate, update.nominal)


@pytest.fixture(scope="module")
def updated(update: UrdfUpdate, found: ConsistentEstimate) -> UpdatedUrdf:
    return update.with_model(ExportModel.from_closest_robot(found))


def test_pinocchio_computes_the_torques_of_the_true_arm(
    made: IdentifiedUrdf, found: ConsistentEstimate, updated: UpdatedUrdf
) -> None:
    motion = random_motion(4, 100)
    true = rnea(made.truth, *motion)
    arm = made.arm_of(updated.data)
    model = ExportModel.from_closest_robot(found)
    arm.armature = np.array([model.armature(j) for j in range(4)])
    np.testing.assert_allclose(rnea(arm, *motion), true, atol=1e-4)
    assert np.abs(rnea(made.arm_of(ARM), *motion) - true).max() > 1.0
    np.testing.assert_allclose(arm.friction, FRICTION, atol=1e-6)
    np.testing.assert_allclose(arm.damping, DAMPING, atol=1e-6)


def test_the_kinematics_stay_exactly_the_same(updated: UpdatedUrdf) -> None:
    before, after = (pin.buildModelFromXML(data.decode()) for data in (ARM, updated.data))
    q = pin.randomConfiguration(before, -np.ones(before.nq), np.ones(before.nq))
    places = []
    for model in (before, after):
        data = model.createData()
        pin.framesForwardKinematics(model, data, q)
        places.append(np.array([frame.homogeneous for frame in data.oMf]))
    np.testing.assert_allclose(places[1], places[0], rtol=0.0, atol=1e-12)


def without_changes(data: bytes) -> bytes:
    """Return a URDF without inertials, dynamics, and everything after the root element."""
    inside = data[: data.index(b"</robot>")]
    for pattern in (rb"\s*<inertial>.*?</inertial>", rb"\s*<dynamics[^>]*/>"):
        inside = re.sub(pattern, b"", inside, flags=re.DOTALL)
    return inside


def test_all_bytes_outside_the_changed_elements_stay(updated: UpdatedUrdf) -> None:
    assert without_changes(updated.data) == without_changes(ARM)
    assert b"<mass value = '" in updated.data, "quotes and spaces of a changed attribute"
    assert b"/><!-- from CAD -->" in updated.data
    assert b"\n" not in updated.data.replace(b"\r\n", b"")
    for name in (b"base", b"left", b"right"):
        line = next(line for line in ARM.splitlines() if b'<link name="' + name in line)
        assert line in updated.data, f"{name.decode()} was not measured"


def test_the_link_with_mass_takes_the_change_and_the_others_keep_their_values(
    updated: UpdatedUrdf,
) -> None:
    assert [link.name for link in updated.links] == ["column", "cover", "ram", "hand"]
    assert updated.links[-1].unchanged_links == ("right", "left")
    assert [link.before_kg for link in updated.links] == [3.0, 2.0, 1.5, 0.8]


def test_what_was_not_measured_is_listed(updated: UpdatedUrdf) -> None:
    notes = "\n".join(updated.notes)
    for name in ("base", "left", "right", "finger1", "finger2"):
        assert name in notes
    comment = updated.data[updated.data.index(b"</robot>") :].decode()
    assert comment.count("<!--") == comment.count("-->") == 1
    assert "armature" in comment


def test_an_updated_file_can_be_updated_again(made: IdentifiedUrdf, updated: UpdatedUrdf) -> None:
    model = ExportModel.from_estimate(made.estimate)
    second = UrdfUpdate(updated.data, "again.urdf", model)
    chosen = find_closest(made.estimate, second.nominal)
    again = second.with_model(ExportModel.from_closest_robot(chosen))
    assert again.data.count(b"Updated inertias") == 1
    motion = random_motion(4, 20)
    first, last = (
        arm_of(one.data, made.estimate.robot.joint_names, made.held) for one in (updated, again)
    )
    np.testing.assert_allclose(rnea(first, *motion), rnea(last, *motion), atol=1e-4)


def test_directions_without_torque_keep_the_values_of_the_urdf(
    made: IdentifiedUrdf, found: ConsistentEstimate, updated: UpdatedUrdf
) -> None:
    # The mass of the first link turns about a vertical axis through its own frame: no torque.
    assert updated.links[0].body.mass_kg == pytest.approx(3.0, rel=1e-6)
    assert np.abs(found.moved_sigmas).max() < 0.1


@pytest.mark.skipif(shutil.which("check_urdf") is None, reason="liburdfdom-tools is not installed")
def test_urdfdom_reads_the_same_tree(updated: UpdatedUrdf, tmp_path: Path) -> None:
    trees = []
    for name, data in (("before", ARM), ("after", updated.data)):
        (tmp_path / name).write_bytes(data)
        command = ["check_urdf", str(tmp_path / name)]
        judged = subprocess.run(command, capture_output=True, text=True, check=True)
        trees.append(judged.stdout)
    assert trees[0] == trees[1]
    assert "Successfully Parsed XML" in trees[1]


def test_mujoco_computes_the_torques_of_the_true_arm(
    made: IdentifiedUrdf, found: ConsistentEstimate, updated: UpdatedUrdf
) -> None:
    built = mujoco.MjModel.from_xml_string(updated.data.decode())
    data = mujoco.MjData(built)
    names = ("turn", "lift", "slide", "wrist")
    columns = [built.joint(name).dofadr[0] for name in names]
    fingers = [built.joint(name).qposadr[0] for name in ("finger1", "finger2")]
    np.testing.assert_allclose(built.dof_frictionloss[columns], FRICTION, atol=1e-6)
    np.testing.assert_allclose(built.dof_damping[columns], DAMPING, atol=1e-6)
    built.dof_frictionloss[:] = built.dof_damping[:] = 0.0
    model = ExportModel.from_closest_robot(found)
    built.dof_armature[columns] = [model.armature(j) for j in range(4)]
    built.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    motion = random_motion(4, 40)
    torques = []
    for q, v, a in zip(*motion, strict=True):
        data.qpos[columns], data.qvel[columns], data.qacc[columns] = q, v, a
        data.qpos[fingers] = 0.01
        mujoco.mj_inverse(built, data)
        torques.append(data.qfrc_inverse[columns].copy())
    np.testing.assert_allclose(torques, rnea(made.truth, *motion), atol=1e-4)


def other_robot(made: IdentifiedUrdf, **changes: float) -> ExportModel:
    """Return the identified robot with another value in the third kinematic row."""
    robot = made.estimate.robot
    rows = list(robot.kinematics.rows)
    rows[2] = KinematicRow(**{**rows[2].model_dump(), **changes})
    kinematics = Kinematics(convention="modified_dh", rows=tuple(rows))
    other = robot.model_copy(update={"kinematics": kinematics})
    return ExportModel.from_estimate(replace(made.estimate, robot=other))


@pytest.mark.parametrize("change", [{"alpha_rad": 0.5}, {"beta_rad": 0.1}])
def test_a_urdf_with_other_axes_is_refused(made: IdentifiedUrdf, change: dict[str, float]) -> None:
    with raises_code(ConfigError, "RID-URDF-KINEMATICS", "arm.urdf", "slide"):
        UrdfUpdate(ARM, "arm.urdf", other_robot(made, **change))


@pytest.mark.parametrize(
    ("old", "new", "joint"),
    [
        (b'<axis xyz="0 0 -1"/>', b'<axis xyz="0 0 1"/>', "lift"),
        (b'<origin xyz="0.05 0 0.1"', b'<origin xyz="0.06 0 0.1"', "lift"),
        (b'name="slide" type="prismatic"', b'name="slide" type="revolute"', "slide"),
        (b'name="lift" type="revolute"', b'name="lift" type="fixed"', "turn"),
    ],
)
def test_a_changed_joint_is_named(made: IdentifiedUrdf, old: bytes, new: bytes, joint: str) -> None:
    assert old in ARM
    with raises_code(ConfigError, "RID-URDF-KINEMATICS", joint):
        UrdfUpdate(ARM.replace(old, new), "arm.urdf", ExportModel.from_estimate(made.estimate))


def test_two_equal_arms_need_a_tip(made: IdentifiedUrdf) -> None:
    text = ARM.decode()
    start, end = text.index('  <joint name="turn"'), text.index("  <ros2_control")
    copy = re.sub(r'(name|link|joint)=(["\'])(?!base")', r"\1=\2second_", text[start:end])
    # The joints' names would choose one of the arms.
    both = (text[:end] + copy + text[end:]).replace('name="turn"', 'name="pan"').encode()
    model = ExportModel.from_estimate(made.estimate)
    with raises_code(ConfigError, "RID-URDF-ARM", "second_hand", "2 arms"):
        UrdfUpdate(both, "two.urdf", model)
    chosen = UrdfUpdate(both, "two.urdf", model, "second_hand")
    assert chosen.bodies.changed == ("second_column", "second_cover", "second_ram", "second_hand")


def test_a_base_that_stands_elsewhere_is_the_same_robot(made: IdentifiedUrdf) -> None:
    old = b'<origin rpy="0 0 0.3" xyz="0 0 0.2"/>'
    assert old in ARM
    moved = ARM.replace(old, b'<origin rpy="0 0 -1" xyz="1 2 3"/>')
    update = UrdfUpdate(moved, "moved.urdf", ExportModel.from_estimate(made.estimate))
    chosen = find_closest(made.estimate, update.nominal)
    arm = made.arm_of(update.with_model(ExportModel.from_closest_robot(chosen)).data)
    model = ExportModel.from_closest_robot(chosen)
    arm.armature = np.array([model.armature(j) for j in range(4)])
    motion = random_motion(4, 20)
    np.testing.assert_allclose(rnea(arm, *motion), rnea(made.truth, *motion), atol=1e-4)


def test_unchanged_links_that_are_too_heavy_are_refused(made: IdentifiedUrdf) -> None:
    heavy = ARM.replace(b'<mass value="0.1"/>', b'<mass value="50"/>')
    model = ExportModel.from_estimate(made.estimate)
    other = UrdfUpdate(heavy, "heavy.urdf", model)
    light = find_closest(made.estimate).standard_values
    with raises_code(EstimationError, "RID-EXPORT-FIXED-LINKS", "hand", "left", "right", "100 kg"):
        other.with_model(replace(model, parameters=light))


def test_the_urdf_is_read_back_as_it_was_intended(
    update: UrdfUpdate, found: ConsistentEstimate, updated: UpdatedUrdf
) -> None:
    tree = read_urdf(updated.data, "arm.urdf", literal_angles=True)
    total = sum(link.inertial.mass_kg for link in tree.links.values() if link.inertial)
    bodies = found.standard_values[:40].reshape(4, 10)
    assert total == pytest.approx(4.0 + bodies[:, 0].sum())


def test_a_file_in_another_encoding_keeps_it_or_becomes_utf_8(
    made: IdentifiedUrdf, found: ConsistentEstimate
) -> None:
    latin = ARM.decode().replace("utf-8", "iso-8859-1").encode("iso-8859-1")
    identified, model = (
        ExportModel.from_estimate(made.estimate),
        ExportModel.from_closest_robot(found),
    )
    written = UrdfUpdate(latin, "latin.urdf", identified).with_model(model).data
    assert without_changes(written) == without_changes(latin)
    assert read_urdf(written, "latin.urdf").links.keys() == read_urdf(ARM, "arm.urdf").links.keys()
    wide = ARM.decode().replace("utf-8", "utf-16").encode("utf-16")
    updated = UrdfUpdate(wide, "wide.urdf", identified).with_model(model)
    assert without_changes(updated.data) == without_changes(ARM)
    assert any("UTF-8" in note for note in updated.notes)


def test_a_urdf_without_masses_gets_them(made: IdentifiedUrdf) -> None:
    bare = re.sub(rb"<inertial>.*?</inertial>", b"", ARM, flags=re.DOTALL)
    update = UrdfUpdate(bare, "bare.urdf", ExportModel.from_estimate(made.estimate))
    chosen = find_closest(made.estimate, update.nominal)
    written = update.with_model(ExportModel.from_closest_robot(chosen))
    assert [link.before_kg for link in written.links] == [None] * 4
    assert sum("a guess" in note for note in written.notes) == 4
    arm = made.arm_of(written.data)
    model = ExportModel.from_closest_robot(chosen)
    arm.armature = np.array([model.armature(j) for j in range(4)])
    motion = random_motion(4, 20)
    np.testing.assert_allclose(rnea(arm, *motion), rnea(made.truth, *motion), atol=1e-3)


SCARA = b"""<robot name="scara"><link name="base"/>
<joint name="a" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 0 1"/>
<origin xyz="0 0 0.3" rpy="0 0 0"/><limit lower="-2" upper="2" effort="50" velocity="3"/></joint>
<link name="one"><inertial><origin xyz="0.2 0 0"/><mass value="4"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>
<joint name="b" type="revolute"><parent link="one"/><child link="two"/><axis xyz="0 0 1"/>
<origin xyz="0.4 0.01 0.1"/><limit lower="-2" upper="2" effort="50" velocity="3"/></joint>
<link name="two"><inertial><origin xyz="0.1 0 0"/><mass value="3"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
<joint name="c" type="prismatic"><parent link="two"/><child link="three"/><axis xyz="0 0 -1"/>
<origin xyz="0.3 0 0"/><limit lower="0" upper="0.2" effort="50" velocity="1"/></joint>
<link name="three"><inertial><mass value="1"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link></robot>"""


def test_an_arm_with_parallel_axes_is_found_by_their_distances() -> None:
    made = identified_urdf(SCARA)
    model = ExportModel.from_estimate(made.estimate)
    turned = SCARA.replace(b'xyz="0 0 0.3" rpy="0 0 0"', b'xyz="1 2 3" rpy="0 0 2"')
    update = UrdfUpdate(turned, "scara.urdf", model)
    chosen = find_closest(made.estimate, update.nominal)
    arm = made.arm_of(update.with_model(ExportModel.from_closest_robot(chosen)).data)
    consistent_model = ExportModel.from_closest_robot(chosen)
    arm.armature = np.array([consistent_model.armature(j) for j in range(3)])
    motion = random_motion(3, 20)
    offsets = [consistent_model.straight_friction(j).offset for j in range(3)]
    np.testing.assert_allclose(rnea(arm, *motion) + offsets, rnea(made.truth, *motion), atol=1e-3)
    # A calibrated robot file: the second axis leans by 0.3 mrad.
    leaning = SCARA.replace(b'xyz="0.4 0.01 0.1"', b'xyz="0.4 0.01 0.1" rpy="0.0003 0 0"')
    calibrated = UrdfUpdate(leaning, "leaning.urdf", model)
    np.testing.assert_allclose(calibrated.nominal.unchanged, 0.0)
    notes = calibrated.with_model(consistent_model).notes
    assert sum("mrad" in note for note in notes) == 1
    with raises_code(ConfigError, "RID-URDF-KINEMATICS", "b "):
        UrdfUpdate(SCARA.replace(b"0.4 0.01", b"0.42 0.01"), "longer.urdf", model)
