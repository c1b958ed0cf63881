"""Robots from URDFs, compared with Pinocchio, which reads the same files."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.errors import ConfigError
from config.formats.urdf import rotation_of_rpy, rpy_of_rotation
from config.formats.urdf_file import read_urdf
from config.formats.yaml_tree import parse_yaml
from config.load import to_yaml, validate
from config.robot.robot import RobotDescription
from config.robot.urdf_robot import robot_of_urdf
from dynamics.geometry.kinematics import Chain, forward, jacobian, link_transforms
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import RobotModel, torque
from tests.builders.raised_codes import raises_code

LIMIT = '<limit lower="-2" upper="2" effort="50" velocity="2"/>'


def spaced(values) -> str:
    return " ".join(f"{value:.17g}" for value in values)


def link(name: str, rng: np.random.Generator | None = None) -> str:
    if rng is None:
        return f'<link name="{name}"/>'
    root = rng.normal(0.0, 0.2, (3, 3))
    inertia = np.trace(root @ root.T) * np.eye(3) - root @ root.T + 0.01 * np.eye(3)
    xx, xy, xz, yy, yz, zz = inertia[np.triu_indices(3)]
    return (
        f'<link name="{name}"><inertial>'
        f'<origin xyz="{spaced(rng.normal(0, 0.3, 3))}" '
        f'rpy="{spaced(rng.uniform(-3, 3, 3))}"/>'
        f'<mass value="{rng.uniform(0.5, 9.0)}"/>'
        f'<inertia ixx="{xx}" ixy="{xy}" ixz="{xz}" iyy="{yy}" iyz="{yz}" izz="{zz}"/>'
        "</inertial></link>"
    )


def joint(name: str, kind: str, parent: str, child: str, **more: str) -> str:
    axis = f'<axis xyz="{more["axis"]}"/>' if "axis" in more else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{more.get("xyz", "0 0 0")}" rpy="{more.get("rpy", "0 0 0")}"/>{axis}'
        f"{more.get('limit', LIMIT if kind != 'fixed' else '')}</joint>"
    )


def robot(*parts: str) -> bytes:
    return f'<robot name="r">{"".join(parts)}</robot>'.encode()


# Difficult chains: parallel, coincident, intersecting, nearly parallel, skew, along x.
AXES = ("1 0 0", "0 1 0", "0 0 1", "0 0 -1", "0 -1 0", "skew", "near")
PLACES = ("0 0 0", "0 0 0.4", "0.3 0 0", "0 -0.2 0", "skew")
TURNS = ("0 0 0", "1.5707963267948966 0 0", "0 -1.5707963267948966 0", "0 0 3.141592653589793")
JOINTS = st.tuples(
    st.sampled_from(["revolute", "prismatic", "continuous", "fixed"]),
    st.sampled_from(AXES),
    st.sampled_from(PLACES),
    st.sampled_from((*TURNS, "skew")),
    st.integers(0, 10_000),
)


def chain(joints: list[tuple[str, str, str, str, int]]) -> tuple[bytes, str]:
    parts = [link("l0")]
    for i, (kind, axis, place, turn, seed) in enumerate(joints, start=1):
        rng = np.random.default_rng(seed)
        chosen = {
            "axis": {"skew": spaced(rng.normal(0, 1, 3)), "near": "1e-4 -2e-4 1"}.get(axis, axis),
            "xyz": spaced(rng.normal(0, 0.4, 3)) if place == "skew" else place,
            "rpy": spaced(rng.uniform(-3, 3, 3)) if turn == "skew" else turn,
        }
        parts += [link(f"l{i}", rng), joint(f"j{i}", kind, f"l{i - 1}", f"l{i}", **chosen)]
    return robot(*parts), f"l{len(joints)}"


class Judge:
    """Pinocchio's reading of a URDF; continuous joints are given by cosine and sine."""

    def __init__(self, data: bytes) -> None:
        self.model: Any = pin.buildModelFromXML(data.decode())
        self.data = self.model.createData()

    def configuration(self, q: np.ndarray) -> np.ndarray:
        parts = [
            [np.cos(x), np.sin(x)] if self.model.joints[i].nq == 2 else [x]
            for i, x in enumerate(q, start=1)
        ]
        return np.concatenate(parts)

    def place(self, q: np.ndarray, frame: str) -> Any:
        pin.framesForwardKinematics(self.model, self.data, self.configuration(q))
        return self.data.oMf[self.model.getFrameId(frame)].copy()

    def torque(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        return pin.rnea(self.model, self.data, self.configuration(q), v, a).copy()

    def jacobian(self, q: np.ndarray, frame: str) -> np.ndarray:
        reference = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        number = self.model.getFrameId(frame)
        position = self.configuration(q)
        return pin.computeFrameJacobian(self.model, self.data, position, number, reference).copy()


@settings(max_examples=120)
@given(st.lists(JOINTS, min_size=1, max_size=7).filter(lambda js: any(j[0] != "fixed" for j in js)))
def test_kinematics_and_dynamics_of_any_chain_agree_with_pinocchio(joints) -> None:
    data, tip = chain(joints)
    judge = Judge(data)
    made = robot_of_urdf(read_urdf(data, "r.urdf", literal_angles=True), tip=tip).robot
    geometry = Chain.from_description(made)
    rng = np.random.default_rng(0)
    q, v, a = rng.uniform(-2, 2, (3, 4, geometry.n))

    places = [judge.place(x, tip) for x in q]
    tool = forward(geometry, q) + np.array(made.base_offset_m)
    np.testing.assert_allclose(tool, [place.translation for place in places], atol=1e-9)
    turned = link_transforms(geometry, q)[:, -1, :3, :3] @ rotation_of_rpy(*made.tool_rpy_rad)
    np.testing.assert_allclose(turned, [place.rotation for place in places], atol=1e-9)
    expected = [judge.jacobian(x, tip) for x in q]
    np.testing.assert_allclose(
        jacobian(geometry, q), np.reshape(expected, (4, 6, geometry.n)), atol=1e-9
    )

    model = RobotModel.from_description(made, rotors=False, friction=False)
    values, _ = cad_parameters(model, made)
    expected = [judge.torque(*sample) for sample in zip(q, v, a, strict=True)]
    np.testing.assert_allclose(torque(model, q, v, a, values), expected, atol=1e-9, rtol=1e-9)


@given(st.tuples(*[st.floats(-7.0, 7.0)] * 3))
def test_every_rotation_has_angles(angles) -> None:
    rotation = rotation_of_rpy(*angles)
    np.testing.assert_allclose(rotation, pin.rpy.rpyToMatrix(*angles), atol=1e-15)
    np.testing.assert_allclose(rotation_of_rpy(*rpy_of_rotation(rotation)), rotation, atol=1e-14)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9])
def test_angles_are_exact_at_a_pitch_of_90_degrees(pitch: float) -> None:
    rotation = pin.rpy.rpyToMatrix(0.3, pitch, -1.1)
    np.testing.assert_allclose(rotation_of_rpy(*rpy_of_rotation(rotation)), rotation, atol=1e-14)


def arm(*more: str, tool: str = "") -> bytes:
    """Return an arm with a vertical axis and two parallel horizontal ones, with rounded angles."""
    return robot(
        link("base"),
        link("column"),
        link("upper"),
        link("fore"),
        joint("turn", "revolute", "base", "column", xyz="0 0 0.5", axis="0 0 1"),
        joint("lift", "revolute", "column", "upper", xyz="0.1 0 0", rpy="1.5708 0 0", axis="0 0 1"),
        joint("bend", "revolute", "upper", "fore", xyz="0.4 0 0", axis="0 0 1"),
        *more,
        tool,
    )


def test_rows_of_a_simple_arm_are_the_usual_ones() -> None:
    made = robot_of_urdf(read_urdf(arm(), "arm.urdf"))
    rows = made.robot.kinematics.rows
    assert [row.alpha_rad for row in rows] == [0.0, np.pi / 2, 0.0]
    assert [row.a_m for row in rows] == pytest.approx([0.0, 0.1, 0.4])
    assert [row.d_m for row in rows] == pytest.approx([0.5, 0.0, 0.0])
    assert [row.beta_rad for row in rows] == [0.0] * 3
    assert made.robot.base_offset_m == (0.0, 0.0, 0.0)
    assert any("1 rounded angles were read" in note for note in made.notes)


def test_limits_and_gear_ratios_are_imported() -> None:
    transmission = (
        '<transmission name="t"><joint name="lift"/><actuator name="m">'
        "<mechanicalReduction>101.5</mechanicalReduction></actuator></transmission>"
    )
    made = robot_of_urdf(read_urdf(arm(transmission), "arm.urdf")).robot
    limits = made.joints[1].limits
    assert (limits.position_min, limits.position_max) == (-2.0, 2.0)
    assert (limits.velocity, limits.torque, limits.acceleration) == (2.0, 50.0, 10.0)
    assert [joint.gear_ratio for joint in made.joints] == [1.0, 101.5, 1.0]


@pytest.mark.parametrize(
    ("transmission", "ratio", "expected_text"),
    [
        ('<joint name="lift"/><mechanicalReduction>-50</mechanicalReduction>', 50.0, "is -50"),
        (
            '<joint name="lift"/><actuator name="m"><drake:gear_ratio value="9"/></actuator>',
            9.0,
            "",
        ),
        ('<joint name="lift"><mechanical_reduction>81</mechanical_reduction></joint>', 81.0, ""),
        ('<joint name="lift"><mechanicalReduction/></joint>', 1.0, "''"),
        ('<joint name="lift"><mechanicalReduction>0</mechanicalReduction></joint>', 1.0, "'0'"),
        (
            '<joint name="lift"/><joint name="bend"/><mechanicalReduction>9</mechanicalReduction>'
            "<mechanicalReduction>8</mechanicalReduction>",
            1.0,
            "'9 8'",
        ),
    ],
)
def test_reductions_in_every_notation_are_read_and_placeholders_reported(
    transmission: str, ratio: float, expected_text: str
) -> None:
    data = arm(f'<transmission name="t">{transmission}</transmission>')
    made = robot_of_urdf(read_urdf(data, "arm.urdf"))
    assert made.robot.joints[1].gear_ratio == ratio
    notes = [note for note in made.notes if note.startswith("gear_ratio of lift")]
    assert all(expected_text in note for note in notes)
    assert bool(notes) == bool(expected_text)


def test_visual_elements_may_stay_unexpanded_and_shapes_without_size_are_reported() -> None:
    shape = "<collision><geometry><box size='0 0 0'/></geometry></collision>"
    link = f'<link name="tool"><visual><xacro:grey/></visual>{shape}</link>'
    data = arm(link, tool=joint("mount", "fixed", "fore", "tool"))
    made = robot_of_urdf(read_urdf(data, "arm.urdf"))
    assert made.robot.bodies == ()
    assert "tool: a <box> without size is ignored" in made.notes


def test_a_robot_from_a_urdf_is_a_complete_robot_file() -> None:
    made = robot_of_urdf(read_urdf(arm(), "arm.urdf")).robot
    again = validate(parse_yaml(to_yaml(made).encode(), "robot.yaml"), RobotDescription)
    assert again == made


def test_collision_shapes_become_bodies_and_meshes_a_note() -> None:
    shapes = (
        '<link name="tool"><collision><origin xyz="0 0 0.1"/><geometry><sphere radius="0.05"/>'
        '</geometry></collision><collision><geometry><box size="0.2 0.4 0.6"/></geometry>'
        '</collision><collision><geometry><cylinder radius="0.1" length="0.3"/></geometry>'
        '</collision><collision><geometry><mesh filename="tool.stl"/></geometry></collision></link>'
    )
    data = arm(shapes, tool=joint("mount", "fixed", "fore", "tool", xyz="0.3 0 0"))
    made = robot_of_urdf(read_urdf(data, "arm.urdf"), tip="tool")
    ball, box, cylinder = made.robot.bodies
    assert ball.kind == "capsule"
    assert ball.start_m == pytest.approx((0.3, 0.0, 0.1))
    assert box.kind == "hull"
    np.testing.assert_allclose(np.ptp(box.points_m, axis=0), (0.2, 0.4, 0.6))
    assert cylinder.kind == "hull"
    xs = np.array(cylinder.points_m)[:16, :2] - (0.3, 0.0)
    middles = [0.5 * (p + q) for p, q in pairwise(xs)]
    assert np.linalg.norm(middles, axis=1) == pytest.approx(0.1)  # it encloses the cylinder
    assert {body.link for body in made.robot.bodies} == {3}
    assert any("the collision meshes of tool were not read" in note for note in made.notes)


def test_a_moving_branch_is_fixed_at_zero_and_reported() -> None:
    finger = link("finger", np.random.default_rng(1))
    data = arm(finger, tool=joint("grip", "prismatic", "fore", "finger", axis="0 1 0"))
    other = arm(
        finger,
        link("cup"),
        joint("grip", "prismatic", "fore", "finger", axis="0 1 0"),
        tool=joint("suck", "revolute", "fore", "cup", axis="0 0 1"),
    )
    assert len(robot_of_urdf(read_urdf(data, "arm.urdf")).robot.joints) == 3
    assert len(robot_of_urdf(read_urdf(data, "arm.urdf"), tip="finger").robot.joints) == 4
    made = robot_of_urdf(read_urdf(data, "arm.urdf"), tip="fore")
    assert len(made.robot.joints) == 3
    assert any("'grip' is held at zero" in note for note in made.notes)
    gripped = robot_of_urdf(read_urdf(other, "arm.urdf"))
    assert len(gripped.robot.joints) == 3
    assert (
        "the arm ends at 'fore', because a gripper begins there; --tip chooses another end"
        in gripped.notes
    )
    assert any("'grip', 'suck' are held at zero" in note for note in gripped.notes)


def test_gravity_is_in_the_axes_of_the_base() -> None:
    data = robot(
        link("world"),
        link("wall"),
        link("arm"),
        joint("mount", "fixed", "world", "wall", rpy="0 1.57079632679 0"),
        joint("turn", "revolute", "wall", "arm", axis="0 0 1"),
    )
    upright = robot_of_urdf(read_urdf(data, "wall.urdf"))
    on_wall = robot_of_urdf(read_urdf(data, "wall.urdf"), base="wall")
    assert upright.robot.gravity_m_s2 == (0.0, 0.0, -9.81)
    assert on_wall.robot.gravity_m_s2 == pytest.approx((9.81, 0.0, 0.0), abs=1e-12)


def test_a_link_mass_in_grams_is_reported() -> None:
    def body(name: str, mass: float) -> str:
        inertia = '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/>'
        inertial = f'<inertial><mass value="{mass}"/>{inertia}</inertial>'
        return f'<link name="{name}">{inertial}</link>'

    parts, before = [link("base")], "base"
    for name, mass in (("one", 4.0), ("two", 2500.0), ("three", 1.5)):
        parts.append(body(name, mass))
        parts.append(joint(f"to_{name}", "revolute", before, name, axis="0 0 1"))
        before = name
    made = robot_of_urdf(read_urdf(robot(*parts), "r.urdf"))
    (note,) = (note for note in made.notes if "grams" in note)
    assert note.startswith("link 2 (two) has 2500 kg, all others together 5.5 kg: is its mass in")
    parts[3] = body("two", 2.5)
    assert not [n for n in robot_of_urdf(read_urdf(robot(*parts), "r.urdf")).notes if "grams" in n]


def test_a_link_inertia_rounded_to_zero_is_reported() -> None:
    zeros = '<inertia ixx="0.000" ixy="0" ixz="0" iyy="0.000" iyz="0" izz="0.000"/>'
    flange = f'<link name="flange"><inertial><mass value="0.2"/>{zeros}</inertial></link>'
    one = joint("one", "revolute", "base", "flange", axis="0 0 1")
    made = robot_of_urdf(read_urdf(robot(link("base"), flange, one), "r.urdf"))
    note = next(note for note in made.notes if "no inertia" in note)
    assert "link 1 (flange) has 0.2 kg and almost no inertia" in note
    assert "--cad-prior treats it as unknown" in note
    assert made.robot.cad is not None
    validate(parse_yaml(to_yaml(made.robot).encode(), "robot.yaml"), RobotDescription)


@pytest.mark.parametrize(
    ("data", "code", "details"),
    [
        (b"not xml", "RID-FILE-SYNTAX", ("bad.urdf:1:1: ",)),
        (b"<sdf/>", "RID-FILE-TYPE", ("bad.urdf:1: ", "<sdf>", "<robot>")),
        (b'<!DOCTYPE r [<!ENTITY a "b">]><robot>&a;</robot>', "RID-URDF-ENTITY", ("bad.urdf:1: ",)),
        (b"<r>" * 90, "RID-FILE-SIZE", ("bad.urdf:1: ", "60")),
        (b" " * 20_000_001, "RID-FILE-SIZE", ("bad.urdf: ", "20000001 bytes", "20000000")),
        (robot(link("a"), link("a")), "RID-URDF-STRUCTURE", ("bad.urdf:1: ", "link", "'a'")),
        (robot(link("a"), link("b")), "RID-URDF-ARM", ("bad.urdf: ", " a, b")),
        (robot(link("a")), "RID-URDF-ARM", ("bad.urdf: ", " a")),
        (robot(), "RID-URDF-STRUCTURE", ("bad.urdf: ", "xacro")),
        (
            robot(
                *(link("a"), link("b")),
                *(joint("j", "fixed", "a", "b"), joint("k", "fixed", "b", "a")),
            ),
            "RID-URDF-STRUCTURE",
            ("bad.urdf: ", "links a, b"),
        ),
        (robot("<xacro:arm/>", link("a")), "RID-URDF-XACRO", ("bad.urdf: ",)),
        (robot('<link name="a"><xacro:mass/></link>'), "RID-URDF-XACRO", ("bad.urdf: ",)),
        (
            robot(link("a"), link("b"), joint("j", "revolute", "a", "b", xyz="480 0 0")),
            "RID-URDF-VALUE",
            ("bad.urdf: ", "kinematics.rows.0.a_m: 240 m", "240 mm", "0.24 m"),
        ),
        (
            robot(link("a"), link("b"), joint("j", "revolute", "a", "c")),
            "RID-URDF-STRUCTURE",
            ("bad.urdf:1: ", "'j'", "link 'c'"),
        ),
        (
            robot(link("a"), link("b"), joint("j", "ball", "a", "b")),
            "RID-URDF-STRUCTURE",
            ("bad.urdf:1: ", "type 'ball'", "revolute"),
        ),
        (
            robot(link("a"), link("b"), joint("j", "revolute", "a", "b", axis="0 0 0")),
            "RID-URDF-STRUCTURE",
            ("bad.urdf:1: ", "axis"),
        ),
        (
            robot(link("a"), link("b"), joint("j", "revolute", "a", "b", xyz="0 nan 0")),
            "RID-FILE-NUMBER",
            ("bad.urdf:1: xyz", "<origin>", "'0 nan 0'", "3 numbers within"),
        ),
        (
            robot(link("a"), link("b"), joint("j", "planar", "a", "b")),
            "RID-URDF-ARM",
            ("bad.urdf: ", " a"),
        ),
    ],
)  # fmt: skip
def test_an_invalid_urdf_is_refused_with_file_and_line(
    data: bytes, code: str, details: tuple[str, ...]
) -> None:
    with raises_code(ConfigError, code, *details):
        robot_of_urdf(read_urdf(data, "bad.urdf"))


@settings(max_examples=200)
@given(st.data())
def test_a_damaged_file_is_read_or_refused_but_never_crashes(data: Any) -> None:
    whole = bytearray(arm())
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(0, len(whole) - 1))
        whole[at : at + data.draw(st.integers(0, 30))] = data.draw(st.binary(max_size=8))
    try:
        robot_of_urdf(read_urdf(bytes(whole), "damaged.urdf"))
    except ConfigError as error:
        assert "damaged.urdf" in str(error)  # noqa: PT017
