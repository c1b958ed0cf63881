"""A robot with identified inertias as URDF, SDF, MJCF, and as a Python file for Pinocchio.

All of them refuse links that are not physically consistent. Friction is approximated by a straight
line. Rotors, spring and other properties that a format cannot represent are listed at the top of
the file.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.arrays import FloatArray
from config.formats.urdf import rpy_of_rotation
from config.robot.robot import Joint
from dynamics.geometry.kinematics import flange_pose
from identification.consistency.rigid_body import LinkBody
from identification.export.model import ExportModel, StraightFriction
from identification.export.text import (
    comment_text,
    header_lines,
    nested_tuples,
    numbers,
    render,
    source_name,
)


@dataclass(frozen=True, eq=False)
class _Place:
    """A frame relative to the previous frame, as text for the file formats."""

    frame: FloatArray

    @property
    def xyz(self) -> str:
        return numbers(self.frame[:3, 3], " ")

    @property
    def rpy(self) -> str:
        return numbers(rpy_of_rotation(self.frame[:3, :3]), " ")

    @property
    def xyaxes(self) -> str:
        """The x axis and the y axis of the frame."""
        return numbers(self.frame[:3, :2].T.ravel(), " ")

    @property
    def rows(self) -> str:
        return nested_tuples(self.frame[:3, :3])

    @property
    def origin(self) -> str:
        return nested_tuples(self.frame[:3, 3])


@dataclass(frozen=True, eq=False)
class _Link:
    """A link and the joint that moves it, as text for the file formats."""

    name: str
    parent: str
    joint: Joint
    place: _Place
    body: LinkBody
    friction: StraightFriction
    armature: float
    rotor_inertia: float

    @property
    def centre(self) -> str:
        return numbers(self.body.centre_m, " ")

    @property
    def centre_commas(self) -> str:
        return numbers(self.body.centre_m)

    @property
    def inertia(self) -> dict[str, float]:
        elements = zip(("xx", "xy", "xz", "yy", "yz", "zz"), self._upper(), strict=True)
        return {name: float(value) for name, value in elements}

    @property
    def full_inertia(self) -> str:
        """The inertia in MuJoCo's order: xx, yy, zz, xy, xz, yz."""
        return numbers(self._upper()[[0, 3, 5, 1, 2, 4]], " ")

    @property
    def inertia_commas(self) -> str:
        return numbers(self._upper())

    def _upper(self) -> FloatArray:
        return self.body.inertia_kg_m2[np.triu_indices(3)]


def urdf(model: ExportModel) -> str:
    """Return a URDF of the robot.

    The links are `base`, `link1` to the last, and `tool`. If gravity does not point along -z of the
    base, a link `world` with z up is added below the base.

    Raises:
        EstimationError: A link is not physically consistent.
    """
    return _render("robot.urdf.j2", model)


def sdf(model: ExportModel) -> str:
    """Return an SDF model (version 1.7), fixed to the world.

    Raises:
        EstimationError: A link is not physically consistent.
    """
    return _render("robot.sdf.j2", model)


def mjcf(model: ExportModel) -> str:
    """Return a MuJoCo model (MJCF) with armatures, friction, damping and a motor for each joint.

    Raises:
        EstimationError: A link is not physically consistent.
    """
    return _render("robot.mjcf.j2", model)


def pinocchio_model(model: ExportModel) -> str:
    """Return a Python file whose `build_model()` creates the robot in Pinocchio.

    Raises:
        EstimationError: A link is not physically consistent.
    """
    return _render("pinocchio_model.py.j2", model)


def _render(template: str, model: ExportModel) -> str:
    model.require_possible_links()
    upright = np.eye(4)
    upright[:3, :3] = model.upright
    robot = model.robot
    armatures = template.startswith(("pinocchio", "robot.mjcf"))
    return render(
        template,
        name=source_name(robot.name),
        head=header_lines(model),
        left_out=[comment_text(line) for line in model.omitted_properties(armatures=armatures)],
        mount=None if np.array_equal(model.upright, np.eye(3)) else _Place(upright),
        links=[_link(model, number) for number in range(len(robot.joints))],
        tool=_Place(flange_pose(robot)),
        gravity=numbers(model.model.chain.gravity_m_s2),
        gravity_size=float(np.linalg.norm(model.model.chain.gravity_m_s2)),
    )


def _link(model: ExportModel, number: int) -> _Link:
    joint = model.robot.joints[number]
    armature = model.armature(number)
    return _Link(
        name=f"link{number + 1}",
        parent=f"link{number}" if number else "base",
        joint=joint,
        place=_Place(model.placements[number]),
        body=model.links[number],
        friction=model.straight_friction(number),
        armature=armature,
        rotor_inertia=armature / joint.gear_ratio**2,
    )
