"""Exported URDF, SDF and Pinocchio models, read back by others and by hand."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin
import pytest

from config.errors import EstimationError
from config.formats.urdf_file import read_urdf
from config.load import load_robot
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import GravitySpring, Joint, JointLimits, RobotDescription, Rotor
from config.robot.urdf_robot import robot_of_urdf
from dynamics.geometry.kinematics import Chain, forward
from dynamics.model.robot_model import torque
from identification.export.description import pinocchio_model, sdf, urdf
from identification.export.model import ExportModel
from identification.model.options import ModelOptions
from tests.builders.raised_codes import raises_code

# mass, centre, inertia about the centre
GOLDEN = (7.0, (0.1, -0.2, 0.3), (0.4, 0.03, -0.02, 0.5, 0.05, 0.6))


def random_robot(seed: int, kinds: str, gravity=None) -> RobotDescription:
    rng = np.random.default_rng(seed)
    limits = JointLimits(
        position_min=-2.5, position_max=2.0, velocity=3.0, acceleration=9.0, torque=99.0
    )
    return RobotDescription(
        name=f"arm{seed}",
        gravity_m_s2=gravity or (0.0, 0.0, -9.81),
        base_offset_m=tuple(rng.uniform(-1, 1, 3).tolist()),
        kinematics=Kinematics(
            convention="modified_dh",
            rows=tuple(
                KinematicRow(
                    alpha_rad=float(rng.choice([0.0, np.pi / 2, -np.pi / 2, rng.uniform(-3, 3)])),
                    theta_rad=rng.uniform(-3, 3),
                    a_m=rng.uniform(-0.5, 0.5),
                    d_m=rng.uniform(-0.5, 0.5),
                )
                for _ in kinds
            ),
        ),
        tool_offset_m=(0.1, 0.2, 0.3),
        tool_rpy_rad=(0.4, -0.5, 0.6),
        joints=tuple(
            Joint(
                name=f"j{i + 1}",
                type="prismatic" if kind == "P" else "revolute",
                limits=limits,
                friction=("coulomb", "viscous"),
            )
            for i, kind in enumerate(kinds)
        ),
    )


def body(rng: np.random.Generator) -> np.ndarray:
    """Return the ten parameters of a cloud of point masses about the origin."""
    masses, points = rng.uniform(0.1, 1.0, 12), rng.normal(0.0, 0.3, (12, 3))
    first = masses @ points
    inertia = sum(
        m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True)
    )
    return np.array([masses.sum(), *first, *inertia[np.triu_indices(3)]])


def with_bodies(robot: RobotDescription, seed: int = 0) -> ExportModel:
    model = ModelOptions().build(robot)
    rng = np.random.default_rng(seed)
    values = rng.uniform(0.5, 5.0, len(model.parameter_names))
    n = model.chain.n
    values[: 10 * n] = np.concatenate([body(rng) for _ in range(n)])
    return ExportModel(robot, model, values, ("run -- 1",))


def without_friction(model: ExportModel, motion: np.ndarray) -> np.ndarray:
    """Return the torques of the links alone, without friction, rotors and spring."""
    options = ModelOptions(friction=False, rotors=False, spring=False)
    links = options.build(model.robot)
    q, v, a = motion
    return torque(links, q, v, a, model.parameters[: len(links.parameter_names)])


def rnea(pinocchio: Any, motion: np.ndarray) -> np.ndarray:
    data = pinocchio.createData()
    samples = zip(*motion, strict=True)
    return np.array([pin.rnea(pinocchio, data, *sample) for sample in samples])


def tool_points(pinocchio: Any, q: np.ndarray) -> np.ndarray:
    data, frame = pinocchio.createData(), pinocchio.getFrameId("tool")
    points = []
    for x in q:
        pin.framesForwardKinematics(pinocchio, data, x)
        points.append(data.oMf[frame].translation.copy())
    return np.array(points)


def motion_of(n: int) -> np.ndarray:
    return np.random.default_rng(1).uniform(-2.0, 2.0, (3, 10, n))


def child_of(element: Element, path: str) -> Element:
    found = element.find(path)
    assert found is not None
    return found


def text_of(element: Element, path: str) -> str:
    found = element.findtext(path)
    assert found is not None
    return found


def model_of_sdf(text: str) -> Any:
    """Build the Pinocchio model that an SDF describes, by the rules of SDF."""
    root = child_of(ElementTree.fromstring(text), "model")

    def numbers(element: Element, path: str, default: str = "") -> list[float]:
        return [float(word) for word in element.findtext(path, default).split()]

    def place(six: list[float]) -> pin.SE3:
        return pin.SE3(pin.rpy.rpyToMatrix(*six[3:]), np.array(six[:3]))

    model = pin.Model()
    links = {link.attrib["name"]: link for link in root.findall("link")}
    whole = place(numbers(root, "pose", "0 0 0 0 0 0"))
    number = {"base": 0}
    for joint in root.findall("joint"):
        if joint.get("type") == "fixed":
            assert joint.findtext("parent") == "world"
            continue
        child, parent = links[text_of(joint, "child")], text_of(joint, "parent")
        assert child_of(child, "pose").get("relative_to") == parent
        kind = pin.JointModelPZ() if joint.get("type") == "prismatic" else pin.JointModelRZ()
        assert numbers(joint, "axis/xyz") == [0, 0, 1]
        where = place(numbers(child, "pose"))
        if parent == "base":
            where = whole * where
        i = model.addJoint(number[parent], kind, where, joint.get("name"))
        number[child.attrib["name"]] = i
        inertial = child_of(child, "inertial")
        xx, xy, xz, yy, yz, zz = (
            float(text_of(inertial, f"inertia/i{k}")) for k in ("xx", "xy", "xz", "yy", "yz", "zz")
        )
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        centre = place(numbers(inertial, "pose"))
        assert np.array_equal(centre.rotation, np.eye(3))
        mass = float(text_of(inertial, "mass"))
        model.appendBodyToJoint(
            i, pin.Inertia(mass, centre.translation, inertia), pin.SE3.Identity()
        )
    frame = child_of(root, "frame")
    where = place(numbers(frame, "pose"))
    last = number[frame.attrib["attached_to"]]
    model.addFrame(pin.Frame("tool", last, where, pin.FrameType.OP_FRAME))
    return model


ROBOTS = [(seed, kinds) for seed, kinds in enumerate(("R", "RR", "RPR", "RRRRRR", "PRRPRRR"))]


@pytest.mark.parametrize(("seed", "kinds"), ROBOTS)
@pytest.mark.parametrize(
    "read", [lambda m: pin.buildModelFromXML(urdf(m)), lambda m: model_of_sdf(sdf(m))]
)
def test_a_urdf_and_an_sdf_give_the_same_torques_and_points_when_read_back(
    seed, kinds, read
) -> None:
    model = with_bodies(random_robot(seed, kinds), seed)
    motion = motion_of(len(kinds))
    again = read(model)
    assert list(again.names)[1:] == list(model.robot.joint_names)
    np.testing.assert_allclose(rnea(again, motion), without_friction(model, motion), atol=1e-9)
    points = forward(Chain.from_description(model.robot), motion[0])
    points = points + np.array(model.robot.base_offset_m)
    np.testing.assert_allclose(tool_points(again, motion[0]), points, atol=1e-9)


@pytest.mark.parametrize("gravity", [(0.0, 0.0, 9.81), (9.81, 0.0, 0.0), (3.0, -4.0, 8.43623)])
def test_a_tilted_base_is_attached_to_an_upright_world(gravity) -> None:
    model = with_bodies(random_robot(3, "RRR", gravity))
    motion = motion_of(3)
    size = float(np.linalg.norm(gravity))
    for again in (pin.buildModelFromXML(urdf(model)), model_of_sdf(sdf(model))):
        again.gravity.linear = np.array([0.0, 0.0, -size])
        np.testing.assert_allclose(rnea(again, motion), without_friction(model, motion), atol=1e-9)


@pytest.mark.parametrize("name", ["ir361", "ur10e"])
def test_an_exported_urdf_is_read_back_as_the_same_robot(name: str) -> None:
    model = with_bodies(load_robot(name))
    again = robot_of_urdf(read_urdf(urdf(model).encode(), "again.urdf"), tip="tool")
    motion = motion_of(len(model.robot.joints))
    assert again.robot.joint_names == model.robot.joint_names
    assert [j.gear_ratio for j in again.robot.joints] == [j.gear_ratio for j in model.robot.joints]
    before, after = model.robot.joints[1].limits, again.robot.joints[1].limits
    assert (after.position_min, after.velocity, after.torque) == (
        before.position_min, before.velocity, before.torque
    )  # fmt: skip
    upright = model.upright
    points = forward(Chain.from_description(model.robot), motion[0]) @ upright.T
    offset = np.array(again.robot.base_offset_m)
    now = forward(Chain.from_description(again.robot), motion[0]) + offset
    np.testing.assert_allclose(now, points, atol=1e-9)


def test_the_pinocchio_file_builds_the_robot_with_its_armatures(tmp_path: Path) -> None:
    robot = random_robot(2, "RPR")
    joints = [replace_fields(joint, armature=True, gear_ratio=50.0) for joint in robot.joints]
    model = with_bodies(robot.model_copy(update={"joints": tuple(joints)}))
    built = load(pinocchio_model(model), tmp_path).build_model()
    motion = motion_of(3)
    armatures = np.array([model.of(f"Ia{i}") for i in (1, 2, 3)])
    expected = without_friction(model, motion) + armatures * motion[2]
    np.testing.assert_allclose(rnea(built, motion), expected, atol=1e-9)
    np.testing.assert_allclose(built.damping, [model.of(f"fv_j{i}") for i in (1, 2, 3)], rtol=1e-9)
    np.testing.assert_allclose(built.friction, [model.of(f"fc_j{i}") for i in (1, 2, 3)], rtol=1e-9)
    np.testing.assert_allclose(built.rotorInertia * built.rotorGearRatio**2, armatures)
    points = forward(Chain.from_description(model.robot), motion[0])
    np.testing.assert_allclose(
        tool_points(built, motion[0]), points + np.array(robot.base_offset_m), atol=1e-9
    )


def test_a_motor_on_its_moved_link_is_counted_with_both_speeds() -> None:
    # (D.27): tau2 = I (1 + mu)^2 a2; the link's inertia already contains I.
    robot = random_robot(1, "RR")
    rotor = Rotor(link=2, axis=(0.0, 0.0, 1.0))
    joints = (robot.joints[0], replace_fields(robot.joints[1], rotor=rotor, gear_ratio=100.0))
    model = with_bodies(robot.model_copy(update={"joints": joints}))
    inertia = model.of("Im2")
    assert model.armature(1) == pytest.approx(inertia * (101.0**2 - 1.0))
    assert model.armature(0) == 0.0


def test_signs_and_frames_of_an_inertia_agree_with_values_by_hand() -> None:
    # One link that rotates about its z axis; the expected values are computed by hand.
    robot = random_robot(0, "R")
    mass, centre, (xx, xy, xz, yy, yz, zz) = GOLDEN
    x, y, z = centre
    about_origin = [
        xx + mass * (y * y + z * z), xy - mass * x * y, xz - mass * x * z,
        yy + mass * (x * x + z * z), yz - mass * y * z, zz + mass * (x * x + y * y),
    ]  # fmt: skip
    model = ModelOptions(friction=False).build(robot)
    first = [mass * c for c in centre]
    exported = ExportModel(robot, model, np.array([mass, *first, *about_origin]))
    link = child_of(ElementTree.fromstring(urdf(exported)).findall("link")[1], "inertial")
    origin = child_of(link, "origin")
    assert origin.get("rpy") == "0 0 0"
    written = [float(word) for word in origin.attrib["xyz"].split()]
    assert written == pytest.approx(centre)  # the origin is the centre of gravity and not the axis
    inertia = {key: float(value) for key, value in child_of(link, "inertia").attrib.items()}
    assert inertia == pytest.approx(
        {"ixx": 0.4, "ixy": 0.03, "ixz": -0.02, "iyy": 0.5, "iyz": 0.05, "izz": 0.6}
    )
    again = pin.buildModelFromXML(urdf(exported)).inertias[1]
    np.testing.assert_allclose(again.inertia, [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    tree = ElementTree.fromstring(sdf(exported))
    assert float(text_of(tree, ".//inertia/ixy")) == pytest.approx(0.03)
    assert float(text_of(tree, ".//inertia/ixz")) == pytest.approx(-0.02)


def test_nonlinear_friction_is_exported_as_the_best_line_with_a_note() -> None:
    robot = random_robot(1, "RR")
    joint = replace_fields(robot.joints[0], friction=("coulomb", "viscous", "offset", "cube_root"))
    model = with_bodies(robot.model_copy(update={"joints": (joint, robot.joints[1])}))
    straight = model.straight_friction(0)
    v = np.linspace(0.06, 3.0, 200)
    truth = model.of("fc_j1") + model.of("fv_j1") * v + model.of("fcr_j1") * np.cbrt(v)
    nearest = np.polynomial.Polynomial.fit(v, truth, 1).convert().coef
    assert (straight.friction, straight.damping) == pytest.approx(tuple(nearest))
    assert straight.offset == pytest.approx(model.of("fo_j1"))
    head = urdf(model).partition("<robot")[0]
    assert "the curve of the friction of j1 (cube root): the file has a straight line" in head
    assert "constant part of the friction of j1" in head
    assert "friction of j2" not in head


def test_terms_that_a_urdf_cannot_represent_are_listed_in_it() -> None:
    model = with_bodies(load_robot("ir361"))
    head = urdf(model).partition("<robot")[0]
    assert "the spring across axis2 (k_spring = " in head
    assert "the effect of the rotor of axis3" in head
    ElementTree.fromstring(urdf(model))
    ElementTree.fromstring(sdf(model))


def test_friction_of_a_coupled_actuator_is_omitted_with_a_note() -> None:
    robot = random_robot(1, "RRR").model_copy(
        update={"coupling": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.5, 1.0))}
    )
    model = with_bodies(robot)
    assert [model.is_coupled(j) for j in range(3)] == [False, True, True]
    assert model.straight_friction(1).damping == 0.0
    assert "friction and rotor of j3" in urdf(model)


@pytest.mark.fault(33)
@pytest.mark.parametrize(
    ("change", "details"),
    [
        ((0, -1.0), ("link 1", "mass -1 kg")),
        ((4, -90.0), ("link 1", "moments -90.4, ")),
        ((0, 0.0), ("links' masses",)),
    ],
)
@pytest.mark.parametrize("form", [urdf, sdf, pinocchio_model])
def test_physically_inconsistent_links_are_refused(
    form, change, details, measured: Callable[[str], None]
) -> None:
    model = with_bodies(random_robot(1, "RR"))
    values = np.array(model.parameters)
    values[change[0]] = change[1]
    with raises_code(EstimationError, "RID-EXPORT-LINKS", *details):
        form(replace(model, parameters=values))
    measured("refused: negative mass, impossible inertia")


def test_a_spring_without_known_distances_is_listed() -> None:
    robot = random_robot(1, "RR").model_copy(
        update={"spring": GravitySpring(joint="j2", form="fourier")}
    )
    assert "A1_spring = " in urdf(with_bodies(robot))


def replace_fields(joint: Joint, **changes: Any) -> Joint:
    return Joint(**{**joint.model_dump(), **changes})


def load(text: str, folder: Path) -> Any:
    path = folder / "built.py"
    path.write_text(text)
    spec = importlib.util.spec_from_file_location("built", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
