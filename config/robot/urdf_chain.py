"""`UrdfArm`: a chain of driven joints between two links, and the search for it in a URDF."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from config.errors import ConfigError
from config.formats.urdf import MOVING, UrdfJoint, UrdfTree
from config.quantities import MOST_JOINTS
from config.robot.urdf_mimic import CODE, MergedMimic, merged_mimics

SHORTEST_ARM: Final = 3
_FINGER: Final = re.compile(r"grip|finger|knuckle|jaw", re.IGNORECASE)


class SeveralArmsError(ConfigError):
    """A URDF has several arms: `arms`, the longest first."""

    def __init__(self, file: str, arms: Sequence[UrdfArm]) -> None:
        self.arms = tuple(arms)
        choices = "; ".join(f"--tip {arm.tip} ({len(arm.joints)} joints)" for arm in arms)
        super().__init__(
            f"{file}: there are {len(arms)} arms; choose one with --tip; the joints of the other"
            f" arms then count as fixed: {choices}",
            code="RID-URDF-ARM",
        )


@dataclass(frozen=True)
class UrdfArm:
    """A chain of driven joints, base to tip.

    Attributes:
        base, tip: The fixed link, and the link whose origin is the tool point.
        joints: The driven joints between them, at least one.
        gripper: The link at which the arm ends because a gripper begins there.
        side_branches: The last links of shorter chains that were ignored.
        merged: Mimic joints that are part of a driven joint.
    """

    base: str
    tip: str
    joints: tuple[UrdfJoint, ...]
    gripper: str | None = None
    side_branches: tuple[str, ...] = ()
    merged: tuple[MergedMimic, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes about choices that the user may want to change."""
        notes = []
        if self.gripper is not None:
            notes.append(
                f"the arm ends at {self.gripper!r}, because a gripper begins there; --tip chooses"
                " another end"
            )
        if self.side_branches:
            notes.append(
                f"the arm to {self.tip!r} was chosen; {', '.join(self.side_branches)} count as"
                " fixed; --tip chooses another arm"
            )
        notes += [each.note for each in self.merged]
        return tuple(notes)


def arm_between(tree: UrdfTree, base: str | None, tip: str | None) -> UrdfArm:
    """Return the arm between two links, or the only arm of the URDF.

    Args:
        tree: The URDF.
        base: The fixed link; if None, the root of the tree that contains the arm.
        tip: The link whose origin is the tool point; if None, the last link of the only arm.

    Raises:
        SeveralArmsError: There are several arms, and `tip` is None.
        ConfigError: A link does not exist, no joint moves, a joint of the arm mimics another and
            cannot be part of the model (`merged_mimics`), or the arm has too many joints.
    """
    for link in (base, tip):
        if link is not None and link not in tree.links:
            raise ConfigError(
                f"{tree.file}: no link is named {link!r}; links are {', '.join(tree.links)}",
                code="RID-URDF-LINK",
            )
    if tip is not None:
        base = base or tree.root_of(tip)
        joints = tuple(joint for joint in tree.path(base, tip) if joint.is_driven)
        if not joints:
            raise ConfigError(
                f"{tree.file}: no joint moves between {base!r} and {tip!r}; give another --base or"
                " --tip",
                code="RID-URDF-ARM",
            )
        return _supported(tree, UrdfArm(base, tip, joints))
    arms = arms_of(tree, base)
    if not arms:
        roots = base or ", ".join(tree.roots)
        raise ConfigError(
            f"{tree.file}: no joint moves below {roots}; give another --base", code="RID-URDF-ARM"
        )
    longest = arms[0]
    serious = [longest, *(arm for arm in arms[1:] if _is_serious(arm, longest))]
    if len(serious) > 1:
        raise SeveralArmsError(tree.file, serious)
    aside = tuple(arm.tip for arm in arms[1:])
    return _supported(
        tree, UrdfArm(longest.base, longest.tip, longest.joints, longest.gripper, aside)
    )


def arms_of(tree: UrdfTree, base: str | None) -> list[UrdfArm]:
    """Return every chain of driven joints that ends at a gripper or at its last link.

    The longest is first. A gripper begins after at least three joints if the chains beyond are
    shorter than the arm. In addition, several chains must branch from one body, or a joint's name
    must contain grip, finger, knuckle or jaw.
    """
    arms: dict[str, UrdfArm] = {}
    for root in (base,) if base is not None else tree.roots:
        waiting: list[tuple[str, tuple[UrdfJoint, ...]]] = [(root, ())]
        while waiting:
            link, chain = waiting.pop(0)
            moving = _joints_on(tree, link)
            is_gripper = (
                len(chain) >= SHORTEST_ARM
                and (len(moving) > 1 or any(_FINGER.search(joint.name) for joint in moving))
                and _depth(tree, link) < len(chain)
            )
            onwards = [joint for joint in moving if joint.is_driven or _drives_behind(tree, joint)]
            if chain and (is_gripper or not onwards):
                gripper = link if is_gripper else None
                arms[link] = UrdfArm(root, link, chain, gripper)
            else:
                waiting += [
                    (joint.child, (*chain, joint) if joint.is_driven else chain)
                    for joint in onwards
                ]
    return sorted(arms.values(), key=lambda arm: -len(arm.joints))


def held_positions(tree: UrdfTree, arm: UrdfArm) -> dict[str, float]:
    """Return the fixed positions of the moving joints outside the arm, by name [rad or m].

    Each position is within the joint's limits and as close to zero as they allow. A mimic joint has
    the position that follows from the joint that it mimics.

    Raises:
        ConfigError: A joint that mimics a joint of the arm carries mass, which cannot be assigned
            to a link of the arm.
    """
    driven = {joint.name for joint in arm.joints}
    merged = {each.joint.name for each in arm.merged}
    named = {joint.name: joint for joint in tree.joints}
    in_base = set(tree.placements(arm.base))

    def position(joint: UrdfJoint) -> float:
        if joint.mimic is None:
            return 0.0 if joint.name in driven else joint.resting_position
        return joint.mimic.multiplier * position(named[joint.mimic.joint]) + joint.mimic.offset

    problems = []
    for joint in tree.joints:
        leader = joint
        while leader.mimic is not None:
            leader = named[leader.mimic.joint]
        follows = joint.mimic is not None and leader.name in driven and joint.child in in_base
        follows = follows and joint.name not in merged
        if follows and (mass_kg := _mass_behind(tree, joint.child)) > 0.0:
            problems.append(
                f"{joint.where}: joint {joint.name!r} mimics {leader.name!r}, a joint of the arm,"
                f" and carries {mass_kg:g} kg: a link that moves with another joint cannot be part"
                " of the model. Remove <mimic> if the joint has its own motor; otherwise remove the"
                " <inertial> of its links, whose mass is then ignored"
            )
    if problems:
        raise ConfigError("\n".join(problems), code=CODE)
    return {
        joint.name: position(joint)
        for joint in tree.joints
        if joint.kind in MOVING and joint.name not in driven
    }


def _mass_behind(tree: UrdfTree, link: str) -> float:
    """Return the mass of a link and all links below it [kg]."""
    inertial = tree.links[link].inertial
    own = inertial.mass_kg if inertial is not None else 0.0
    below = tree.joints_below.get(link, ())
    return own + sum(_mass_behind(tree, joint.child) for joint in below)


def _joints_on(tree: UrdfTree, link: str) -> list[UrdfJoint]:
    """Return the joints that move on a body, which is a link and all links fixed to it.

    A link behind a joint that no motor can drive is held at zero and belongs to the body.
    """
    moving: list[UrdfJoint] = []
    waiting = [link]
    while waiting:
        for joint in tree.joints_below.get(waiting.pop(0), ()):
            if joint.kind in MOVING:
                moving.append(joint)
            else:
                waiting.append(joint.child)
    return moving


def _drives_behind(tree: UrdfTree, joint: UrdfJoint) -> bool:
    """Return whether a driven joint is below a joint."""
    behind = tree.joints_below.get(joint.child, ())
    return any(each.is_driven or _drives_behind(tree, each) for each in behind)


def _depth(tree: UrdfTree, link: str) -> int:
    """Return the number of moving joints below a link, along the longest chain."""
    depth, level = -1, [link]
    while level:
        depth += 1
        level = [joint.child for above in level for joint in _joints_on(tree, above)]
    return depth


def _is_serious(arm: UrdfArm, longest: UrdfArm) -> bool:
    """Return whether the user may have meant this arm and not the longest one."""
    shared = sum(a is b for a, b in zip(arm.joints, longest.joints, strict=False))
    own, others = len(arm.joints) - shared, len(longest.joints) - shared
    return own >= min(SHORTEST_ARM, others) and 2 * own >= others


def _supported(tree: UrdfTree, arm: UrdfArm) -> UrdfArm:
    """Return the arm with the mimic joints that are part of its driven joints.

    Raises:
        ConfigError: Another joint before the last one is a mimic joint, or there are too many
            joints.
    """
    if len(arm.joints) > MOST_JOINTS:
        raise ConfigError(
            f"{tree.file}: the arm from {arm.base!r} to {arm.tip!r} has {len(arm.joints)} joints;"
            f" at most {MOST_JOINTS} are supported: end it after {MOST_JOINTS} joints with --tip"
            f" {arm.joints[MOST_JOINTS - 1].child}, or begin later with --base",
            code="RID-URDF-ARM",
        )
    path = tree.path(arm.base, arm.tip)
    last = path.index(arm.joints[-1])
    return replace(arm, merged=merged_mimics(tree, path[: last + 1], arm.joints))
