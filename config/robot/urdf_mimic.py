"""Joints of an arm that mimic others: which motors move which joints (`coupling`, 5.18).

Two cases are part of the model exactly. A mimic joint on the axis of a neighbouring driven joint,
with no mass between them, is one joint with it. Such a pair occurs in a parallelogram, which keeps
the angle of the outer link relative to the base. A mimic joint that its own motor turns through a
parallelogram (`release_joints`) keeps its place in the chain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.urdf import MOVING, Mimic, UrdfJoint, UrdfTree

CODE: Final = "RID-URDF-MIMIC"
SAME_DIRECTION: Final = 1e-6
SAME_LINE_M: Final = 1e-6
SPARE: Final = 1e-12
"""Lower bound of the remaining ranges: 0 times infinity would be NaN [rad or m]."""


@dataclass(frozen=True, eq=False)
class MergedMimic:
    """A mimic joint that is one joint with a neighbouring driven joint of the arm.

    Attributes:
        joint: The mimic joint.
        driven: The driven joint with the same axis.
        sign: -1 if their axes have opposite directions.
        leader: The driven joint of the arm that it follows.
        multiplier: Motion of the mimic joint per motion of the leader; the `offset` of <mimic> is
            part of the kinematics.
        between: Links between the two joints; they have no mass.
    """

    joint: UrdfJoint
    driven: UrdfJoint
    sign: int
    leader: UrdfJoint
    multiplier: float
    between: tuple[str, ...]

    @property
    def note(self) -> str:
        """Note for the user: how the mimic joint is modelled."""
        return (
            f"joint {self.joint.name!r} mimics {self.leader.name!r} on the axis of"
            f" {self.driven.name!r}: both are one joint, and `coupling` adds"
            f" {self.sign * self.multiplier:g} times the motion of the motor of"
            f" {self.leader.name!r} to it; {', '.join(self.between)} between them is not part of"
            " the robot's bodies"
        )


def release_joints(tree: UrdfTree, names: Sequence[str]) -> tuple[UrdfTree, dict[str, Mimic]]:
    """Return the URDF with some mimic joints made driven, and the joints that they mimicked.

    Args:
        tree: The URDF.
        names: Joints that their own motors turn through a parallelogram.

    Raises:
        ConfigError: A name is not a mimic joint.
    """
    mimics = {joint.name: joint.mimic for joint in tree.joints if joint.mimic is not None}
    for name in names:
        if name not in mimics:
            raise ConfigError(
                f"{tree.file}: {name!r} is not a joint with <mimic>; these are"
                f" {', '.join(mimics) or 'none'}",
                code=CODE,
            )
    joints = tuple(
        replace(joint, mimic=None) if joint.name in names else joint for joint in tree.joints
    )
    return replace(tree, joints=joints), {name: mimics[name] for name in names}


def merged_mimics(
    tree: UrdfTree, path: Sequence[UrdfJoint], arm: Sequence[UrdfJoint]
) -> tuple[MergedMimic, ...]:
    """Return the mimic joints of an arm, each with the driven joint whose axis it shares.

    Args:
        tree: The URDF.
        path: All joints from the arm's base to its last driven joint.
        arm: The driven joints among them.

    Raises:
        ConfigError: A mimic joint shares no axis with a driven joint, links with mass are between
            them, or it follows no joint of the arm; one line per joint.
    """
    moving = [joint for joint in path if joint.kind in MOVING]
    named = {joint.name: joint for joint in tree.joints}
    places = tree.placements(tree.root_of(path[0].parent), _offsets(tree))
    found: list[MergedMimic] = []
    problems: list[str] = []
    for number, joint in enumerate(moving):
        if joint.mimic is None:
            continue
        leader, multiplier = joint, 1.0
        while leader.mimic is not None:
            multiplier *= leader.mimic.multiplier
            leader = named[leader.mimic.joint]
        heavy: dict[str, float] = {}
        for other in moving[max(0, number - 1) : number + 2]:
            sign = _common_axis(joint, other, places) if other.is_driven else 0
            if not sign or leader not in arm:
                continue
            upper, lower = sorted((joint, other), key=path.index)
            between = _links_between(tree, upper, lower)
            masses = {name: _mass_kg(tree, name) for name in between}
            if not any(masses.values()):
                found.append(MergedMimic(joint, other, sign, leader, multiplier, between))
                break
            heavy |= {name: mass for name, mass in masses.items() if mass}
        else:
            problems.append(_refusal(joint, leader, heavy))
    if problems:
        raise ConfigError("\n".join(problems), code=CODE)
    return tuple(found)


def coupling_of(
    names: Sequence[str], merged: Sequence[MergedMimic], released: Mapping[str, Mimic]
) -> tuple[FloatArray, FloatArray] | None:
    """Return two matrices, (n, n) each; None if every motor moves its own joint only.

    The first is C of q = C alpha. The second converts the positions of the URDF's driven joints, to
    which the URDF's limits apply, to the robot's q.

    Args:
        names: The arm's joints in the URDF.
        merged: Mimic joints that are part of a driven joint.
        released: For each former mimic joint that its own motor turns, its <mimic>.

    Raises:
        ConfigError: The motors cannot set the joints independently.
    """
    n = len(names)
    added, own = np.zeros((n, n)), np.zeros((n, n))
    for each in merged:
        row, column = names.index(each.driven.name), names.index(each.leader.name)
        added[row, column] += each.sign * each.multiplier
    for name, mimic in released.items():
        if name in names and mimic.joint in names:
            own[names.index(name), names.index(mimic.joint)] += mimic.multiplier
    if not added.any() and not own.any():
        return None
    joints_by_urdf = np.eye(n) + added
    matrix = joints_by_urdf @ np.linalg.inv(np.eye(n) - own)
    if np.linalg.matrix_rank(matrix) < n:
        lines = [each.joint.where for each in merged]
        raise ConfigError(
            f"{', '.join(lines)}: the mimic joints cancel the motion of the joints on the same"
            " axis: correct multiplier and axis of <mimic>",
            code=CODE,
        )
    return np.asarray(matrix), joints_by_urdf


def box_inside(matrix: FloatArray, low: FloatArray, high: FloatArray) -> tuple[FloatArray, ...]:
    """Return ranges of q = matrix @ u within which every u is between its limits.

    Each limit of u is first shared equally by the q that change it. What then remains of the limits
    is given to the joints one by one, beginning with the last joint.

    Args:
        matrix: Shape (n, n).
        low, high: Shape (n,). Limits of u.

    Returns:
        Lowest and highest q, (n,) each.
    """
    centre, half = matrix @ (0.5 * (low + high)), 0.5 * (high - low)
    weights = np.abs(np.linalg.inv(matrix))
    weights[weights < SAME_DIRECTION] = 0.0
    per_weight = np.where(weights > 0.0, 1.0 / np.maximum(weights, SAME_DIRECTION), np.inf)
    shared = half / np.count_nonzero(weights, axis=1)
    size = (shared[:, np.newaxis] * per_weight).min(axis=0)
    for joint in reversed(range(len(size))):
        spare = np.maximum(half - weights @ size, SPARE)
        size[joint] += (spare * per_weight[:, joint]).min()
    return centre - size, centre + size


def _offsets(tree: UrdfTree) -> dict[str, float]:
    """Return the positions of the mimic joints if all driven joints are at zero."""
    named = {joint.name: joint for joint in tree.joints}

    def position(joint: UrdfJoint) -> float:
        if joint.mimic is None:
            return 0.0
        return joint.mimic.multiplier * position(named[joint.mimic.joint]) + joint.mimic.offset

    return {joint.name: position(joint) for joint in tree.joints if joint.mimic is not None}


def _common_axis(one: UrdfJoint, other: UrdfJoint, places: Mapping[str, FloatArray]) -> int:
    """Return 1 or -1 if two joints move along the same axis, else 0."""
    slides = [joint.kind == "prismatic" for joint in (one, other)]
    here, there = (places[joint.child] for joint in (one, other))
    u, w = here[:3, :3] @ one.axis, there[:3, :3] @ other.axis
    if slides[0] != slides[1] or np.linalg.norm(np.cross(u, w)) > SAME_DIRECTION:
        return 0
    apart_m = np.linalg.norm(np.cross(there[:3, 3] - here[:3, 3], u))
    if not slides[0] and apart_m > SAME_LINE_M:
        return 0
    return 1 if u @ w > 0.0 else -1


def _links_between(tree: UrdfTree, first: UrdfJoint, second: UrdfJoint) -> tuple[str, ...]:
    """Return the links that move with `first`, but not with `second`, a joint below it."""
    links = [first.child]
    for link in links:
        links += [joint.child for joint in tree.joints_below.get(link, ()) if joint is not second]
    return tuple(links)


def _mass_kg(tree: UrdfTree, link: str) -> float:
    inertial = tree.links[link].inertial
    return 0.0 if inertial is None else inertial.mass_kg


def _refusal(joint: UrdfJoint, leader: UrdfJoint, heavy: Mapping[str, float]) -> str:
    """Return why a mimic joint cannot be part of the model, with the possible remedies."""
    name = joint.name
    if heavy:
        links = ", ".join(f"{link} ({mass:g} kg)" for link, mass in heavy.items())
        why = (
            f"shares its axis with a driven joint, but the links between them have mass: {links}."
            " Remove their <inertial> if it is negligible"
        )
    else:
        why = (
            f"no driven joint has its axis, so that one motor turns two joints of the chain. If"
            f" {name!r} has its own motor and a parallelogram adds the motion of"
            f" {leader.name!r}, give --parallelogram {name}: the robot file gets the `coupling`. If"
            " its own motor is at the joint, remove <mimic>"
        )
    return (
        f"{joint.where}: joint {name!r} mimics {leader.name!r} in the middle of the arm: {why}."
        f" Otherwise give --tip {joint.parent} for the arm before it"
    )
