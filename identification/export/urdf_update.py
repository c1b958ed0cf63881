"""Update of a user's URDF with identified inertias and friction; all other text stays.

Only `<inertial>` of the changed links (`MovingBodies`) and `<dynamics>` of the arm's joints change.
A comment after the robot's end tag has the origin of the values and what the URDF cannot express.
A file in another encoding than UTF-8 is converted to UTF-8.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import EstimationError
from config.formats.urdf_file import read_urdf
from config.formats.xml_edit import XmlEditor
from config.formats.xml_tree import parse_xml, utf8_xml
from dynamics.terms.friction import Friction
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.consistency.closest_robot import NominalLinks
from identification.consistency.rigid_body import LinkBody
from identification.export.model import ExportModel
from identification.export.text import comment_text, header_lines
from identification.export.urdf_arm import read_arm
from identification.export.urdf_bodies import MovingBodies
from identification.export.urdf_elements import write_dynamics, write_inertial

READ_BACK: Final = 1e-7
_OTHER_ENCODING: Final = re.compile(rb"""<\?xml[^>]*encoding\s*=\s*["'](?![Uu][Tt][Ff]-8)""")
_OWN_COMMENT: Final = re.compile(rb"\r?\n<!-- Updated inertias and friction\.(?s:.*?)-->")


@dataclass(frozen=True)
class ChangedLink:
    """A link with a new `<inertial>`; `before_kg` is None if the URDF stated no mass.

    `unchanged_links` are links that move with it and keep their values.
    """

    name: str
    before_kg: float | None
    body: LinkBody
    unchanged_links: tuple[str, ...]


@dataclass(frozen=True)
class ChangedJoint:
    """A joint with a new `<dynamics>`: viscous and Coulomb friction before and now."""

    name: str
    damping_before: float | None
    damping: float
    friction_before: float | None
    friction: float


@dataclass(frozen=True)
class UpdatedUrdf:
    """The updated file.

    Attributes:
        data: The file's bytes.
        joint_names: The arm's joints in the URDF.
        links, joints: The changes.
        stated: Shape (n, 10). Parameters of the moving bodies in the URDF as it was, in the model's
            frames.
        notes: What the URDF cannot express, and what was not measured or not changed.
    """

    data: bytes
    joint_names: tuple[str, ...]
    links: tuple[ChangedLink, ...]
    joints: tuple[ChangedJoint, ...]
    stated: FloatArray
    notes: tuple[str, ...]


class UrdfUpdate:
    """A URDF to be updated, and the arm in it that was identified.

    Raises:
        ConfigError: The file cannot be read, or does not contain the identified robot.
    """

    def __init__(self, data: bytes, file: str, model: ExportModel, tip: str | None = None) -> None:
        """Find the arm in the file.

        Args:
            data: The file's bytes.
            file: Name of the file in messages.
            model: The identified robot; its parameters are not used.
            tip: A link behind the arm's last joint, if the URDF has several equal arms.
        """
        self.file = file
        self._data = utf8_xml(data, file)
        self._is_converted = self._data != data
        self._literal, self._matched = read_arm(self._data, file, model, tip)
        self.bodies = MovingBodies.of(self._matched, model)

    @property
    def is_updated(self) -> bool:
        """True if an earlier export updated the file."""
        return _OWN_COMMENT.search(self._data) is not None

    @property
    def unchanged_links(self) -> tuple[tuple[str, ...], ...]:
        """For each joint, the links with mass that it moves and that keep their values."""
        return tuple(tuple(self.bodies.unchanged_links(j)) for j in range(len(self.bodies.changed)))

    @property
    def nominal(self) -> NominalLinks:
        """The URDF's own inertias, for the directions that torques do not determine."""
        return self.bodies.nominal

    def with_model(self, model: ExportModel) -> UpdatedUrdf:
        """Return the file with a model's parameters.

        Args:
            model: Physically consistent parameters, with the URDF's as nominal ones (`nominal`).

        Raises:
            EstimationError: A link would be physically impossible.
        """
        model.require_possible_links()
        root = parse_xml(self._data, self.file)
        editor = XmlEditor(self._data, root)
        whole = model.parameters[: PARAMETERS_PER_LINK * model.model.chain.n]
        whole = whole.reshape(-1, PARAMETERS_PER_LINK)
        links, joints = [], []
        elements = {each.attributes["name"]: each for each in root.all("link")}
        for number, body in enumerate(self.bodies.changed_bodies(whole)):
            name = self.bodies.changed[number]
            write_inertial(editor, elements[name], body)
            inertial = self._matched.tree.links[name].inertial
            before = None if inertial is None else inertial.mass_kg
            links.append(
                ChangedLink(name, before, body, tuple(self.bodies.unchanged_links(number)))
            )
        elements = {each.attributes["name"]: each for each in root.all("joint")}
        for number, joint in enumerate(self._matched.arm.joints):
            if not _has_friction(model, number):
                continue
            line = model.straight_friction(number)
            write_dynamics(editor, elements[joint.name], line.damping, line.friction)
            joints.append(
                ChangedJoint(joint.name, joint.damping, line.damping, joint.friction, line.friction)
            )
        notes = tuple(self._notes(model))
        changed = editor.result()
        self._verify(changed, whole)
        return UpdatedUrdf(
            _with_comment(changed, self.file, model, notes),
            tuple(joint.name for joint in self._matched.arm.joints),
            tuple(links),
            tuple(joints),
            self.bodies.stated,
            notes,
        )

    def _notes(self, model: ExportModel) -> Iterator[str]:
        matched, bodies = self._matched, self.bodies
        if self._is_converted:
            yield "the original file was not encoded in UTF-8, but the updated file is"
        yield from matched.notes(model)
        yield (
            "the torques of the arm do not depend on the base's inertia: unchanged are"
            f" {', '.join(bodies.carried[0])}"
        )
        inside = {name for names in bodies.carried for name in names}
        outside = [name for name in matched.tree.links if name not in inside]
        if outside:
            yield f"outside the arm, and unchanged: {', '.join(outside)}"
        for number, name in enumerate(bodies.changed):
            others = bodies.unchanged_links(number)
            if others:
                yield (
                    f"{', '.join(others)} move with {name} and keep their values; {name} takes the"
                    " difference between the identified body and their sum"
                )
        yield (
            "whatever was mounted on the flange during the identification is part of the last body,"
            f" and so of {bodies.changed[-1]} unless links of the URDF describe it"
        )
        yield from bodies.held
        for number, comment in bodies.links.comments.items():
            yield f"nominal values of {bodies.changed[number]}: {comment}"
        yield from model.omitted_properties(armatures=False)
        for number, joint in enumerate(matched.arm.joints):
            if not _has_friction(model, number) and not model.is_coupled(number):
                yield f"the model has no friction of {joint.name}: its <dynamics> is unchanged"
            elif model.is_coupled(number) and (joint.damping or joint.friction):
                yield f"<dynamics> of {joint.name} is unchanged, and is not the identified one"
            if joint.rotor_inertia_kg_m2 is not None:
                yield (
                    f"the rotor inertia of {joint.name} in the URDF,"
                    f" {joint.rotor_inertia_kg_m2:g} kg m^2 before the gear, is unchanged; the"
                    f" identified armature is {model.armature(number):.6g} at the link side"
                )
        yield from matched.tree.notes

    def _verify(self, data: bytes, whole: FloatArray) -> None:
        """Read the changed file back, and compare its bodies with the intended ones.

        Raises:
            EstimationError: They differ.
        """
        tree = read_urdf(data, self.file, literal_angles=self._literal)
        read = replace(self.bodies, matched=replace(self._matched, tree=tree)).stated
        size = np.abs(whole).max(axis=1, keepdims=True)
        worst = float(np.max(np.abs(read - whole) / size))
        if worst > READ_BACK:
            raise EstimationError(
                f"the updated URDF differs by {worst:.1e} from the model when read back: it is"
                " discarded",
                code="RID-INTERNAL-ERROR",
            )


def _has_friction(model: ExportModel, joint: int) -> bool:
    found = model.term(Friction)
    return (
        found is not None
        and not model.is_coupled(joint)
        and any(column.joint == joint for column in found[0].columns)
    )


def _with_comment(data: bytes, file: str, model: ExportModel, notes: tuple[str, ...]) -> bytes:
    """Return the file with a comment after the root element; it replaces an earlier one."""
    end = parse_xml(data, file).end
    rest = _OWN_COMMENT.sub(b"", data[end:], count=1)
    lines = [
        "<!-- Updated inertias and friction.",
        *(f"  {line}" for line in header_lines(model)),
        "  Notes:",
        *(f"  - {comment_text(note)}" for note in notes),
        "-->",
    ]
    line_break = "\r\n" if b"\r\n" in data else "\n"
    text = line_break + line_break.join(lines)
    is_utf_8 = _OTHER_ENCODING.match(data) is None
    written = text.encode("utf-8" if is_utf_8 else "ascii", "xmlcharrefreplace")
    return data[:end] + written + rest
