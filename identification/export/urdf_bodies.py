"""`MovingBodies`: for each joint of a URDF's arm, the links that move with it.

A joint moves its child link and all links that are fixed to it. Torques depend on the sum of these
links. One of them, the changed link, takes the difference between the identified body and this sum;
the others keep the values of the URDF.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from config.arrays import FloatArray
from config.errors import EstimationError
from config.formats.urdf import UrdfTree
from config.robot.axis_lines import AxisPoses
from config.robot.urdf_links import UrdfLinks, links_of_urdf
from config.robot.urdf_robot import carried_links
from dynamics.model.cad import about_origin
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.consistency.closest_robot import NominalLinks
from identification.consistency.rigid_body import LinkBody
from identification.export.model import ExportModel
from identification.export.urdf_arm import MatchedArm


@dataclass(frozen=True, eq=False)
class MovingBodies:
    """The bodies of an arm.

    Attributes:
        matched: The arm.
        carried: Names of the links that move together: with the base, then with each joint.
        changed: Name of the changed link of each joint.
        links: Nominal values of the bodies in the model's frames, repaired or guessed if the URDF's
            are impossible or missing.
        held: Notes on joints outside the arm, which are held at a position.
    """

    matched: MatchedArm
    carried: tuple[tuple[str, ...], ...]
    changed: tuple[str, ...]
    links: UrdfLinks
    held: tuple[str, ...]

    @classmethod
    def of(cls, matched: MatchedArm, model: ExportModel) -> MovingBodies:
        """Return the bodies of an arm."""
        held: list[str] = []
        carried = carried_links(matched.tree, matched.arm, held)
        frames = matched.frames
        rows = model.robot.kinematics.modified_rows()
        axes = AxisPoses(frames[0][:3, 3], tuple(rows), frames)
        tool_m = model.model.chain.tool_m
        links = links_of_urdf(matched.tree, carried, matched.places, axes, tool_m)
        changed = tuple(_changed_link(matched.tree, joint.child) for joint in matched.arm.joints)
        return cls(matched, tuple(map(tuple, carried)), changed, links, tuple(held))

    @property
    def nominal(self) -> NominalLinks:
        """The nominal values; links that keep the URDF's values are included."""
        return NominalLinks(self.links.cad, self.unchanged)

    @cached_property
    def unchanged(self) -> FloatArray:
        """Sum of the links that keep their values, in the model's frames, (n, 10)."""
        return np.array(
            [
                self._sum(number, [name for name in names if name != changed])
                for number, (names, changed) in enumerate(
                    zip(self.carried[1:], self.changed, strict=True)
                )
            ]
        )

    @cached_property
    def stated(self) -> FloatArray:
        """Sum of the values that the URDF states for all links, in the model's frames, (n, 10)."""
        return np.array([self._sum(i, list(names)) for i, names in enumerate(self.carried[1:])])

    def unchanged_links(self, number: int) -> list[str]:
        """Return the links with mass that move with a changed link and keep their values."""
        return [
            name
            for name in self.carried[number + 1]
            if name != self.changed[number] and _mass(self.matched.tree, name) > 0.0
        ]

    def changed_bodies(self, identified: FloatArray) -> tuple[LinkBody, ...]:
        """Return the new values of the changed links, in the frames of these links.

        Args:
            identified: Shape (n, 10). Parameters of the bodies in the model's frames.

        Raises:
            EstimationError: The rest of a body without its unchanged links is impossible.
        """
        found = []
        for number, (whole, part) in enumerate(zip(identified, self.unchanged, strict=True)):
            rest = whole - part
            name = self.changed[number]
            body = LinkBody.of(rest) if rest[0] > 0.0 else None
            if body is None or not body.is_consistent:
                raise EstimationError(
                    f"link {name!r} would be physically impossible: the links that are fixed to it"
                    f" ({', '.join(self.unchanged_links(number))}) have {part[0]:.4g} kg of the"
                    f" identified {whole[0]:.4g} kg. Correct their <inertial> in the URDF",
                    code="RID-EXPORT-FIXED-LINKS",
                )
            place = np.linalg.inv(self.matched.places[name]) @ self.matched.frames[number + 1]
            turn = place[:3, :3]
            inertia = turn @ body.inertia_kg_m2 @ turn.T
            centre = turn @ body.centre_m + place[:3, 3]
            found.append(LinkBody(body.mass_kg, centre, (inertia + inertia.T) / 2.0))
        return tuple(found)

    def _sum(self, number: int, names: list[str]) -> FloatArray:
        """Return the sum of links' parameters in the frame of a link of the model, (10,)."""
        total = np.zeros(PARAMETERS_PER_LINK)
        from_base = np.linalg.inv(self.matched.frames[number + 1])
        for name in names:
            inertial = self.matched.tree.links[name].inertial
            if inertial is None:
                continue
            place = from_base @ self.matched.places[name] @ inertial.placement
            turn = place[:3, :3]
            inertia = turn @ inertial.inertia_kg_m2 @ turn.T
            total += about_origin(inertial.mass_kg, place[:3, 3], inertia)
        return total


def _changed_link(tree: UrdfTree, moved: str) -> str:
    """Return the link that takes the difference: the moved one, or the heaviest fixed to it.

    The moved link is chosen if it has mass, or if no link that is fixed to it has any.
    """
    if _mass(tree, moved) > 0.0:
        return moved
    fixed, waiting = [moved], [moved]
    while waiting:
        below = tree.joints_below.get(waiting.pop(0), ())
        names = [joint.child for joint in below if joint.kind == "fixed"]
        fixed += names
        waiting += names
    return max(fixed, key=lambda name: _mass(tree, name))


def _mass(tree: UrdfTree, name: str) -> float:
    inertial = tree.links[name].inertial
    return 0.0 if inertial is None else inertial.mass_kg
