"""`UrdfArm`: a chain of driven joints between two links, and which of them a URDF has."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from config.errors import ConfigError
from config.formats.urdf import MOVING, UrdfJoint, UrdfTree

SHORTEST_ARM: Final = 3
_FINGER: Final = re.compile(r"grip|finger|knuckle|jaw", re.IGNORECASE)


class SeveralArmsError(ConfigError):
    """A URDF has several arms: `arms`, the longest first."""

    def __init__(self, file: str, arms: Sequence[UrdfArm]) -> None:
        self.arms = tuple(arms)
        told = "; ".join(f"--tip {arm.tip} ({len(arm.joints)} joints)" for arm in arms)
        super().__init__(
            f"{file}: there are {len(arms)} arms: say which with --tip; the others then count as"
            f" fixed: {told}",
            code="RID-URDF-ARM",
        )


@dataclass(frozen=True)
class UrdfArm:
    """A chain of driven joints, base to tip.

    Attributes:
        base, tip: The link that stands still, and the link whose origin is the tool point.
        joints: The driven joints between them, at least one.
        gripper: The link on which the arm ends because a gripper begins there.
        side_branches: The last links of shorter chains that were left aside.
    """

    base: str
    tip: str
    joints: tuple[UrdfJoint, ...]
    gripper: str | None = None
    side_branches: tuple[str, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """What was chosen here that a person may want otherwise."""
        notes = []
        if self.gripper is not None:
            notes.append(
                f"the arm ends at {self.gripper!r}, where a gripper begins: --tip takes another"
            )
        if self.side_branches:
            notes.append(
                f"the arm to {self.tip!r} was taken; {', '.join(self.side_branches)} count as"
                " fixed: --tip takes another"
            )
        return tuple(notes)


def arm_between(tree: UrdfTree, base: str | None, tip: str | None) -> UrdfArm:
    """Return the arm between two links, or the only one that there is.

    Args:
        tree: The URDF.
        base: The link that stands still; the root of the longest arm where None.
        tip: The link whose origin is the tool point; the last link of the only arm where None.

    Raises:
        SeveralArmsError: There are several arms, and no tip says which.
        ConfigError: There is no such link, no moving joint, or a joint among them moves as another
            does.
    """
    for link in (base, tip):
        if link is not None and link not in tree.links:
            raise ConfigError(
                f"{tree.file}: there is no link {link!r}; links are {', '.join(tree.links)}",
                code="RID-URDF-LINK",
            )
    if tip is not None:
        base = base or tree.root_of(tip)
        joints = tuple(joint for joint in tree.path(base, tip) if joint.is_driven)
        if not joints:
            raise ConfigError(
                f"{tree.file}: no joint moves between {base!r} and {tip!r}", code="RID-URDF-ARM"
            )
        return _without_mimics(tree, UrdfArm(base, tip, joints))
    arms = arms_of(tree, base)
    if not arms:
        roots = base or ", ".join(tree.roots)
        raise ConfigError(f"{tree.file}: no joint moves below {roots}", code="RID-URDF-ARM")
    longest = arms[0]
    serious = [longest, *(arm for arm in arms[1:] if _is_serious(arm, longest))]
    if len(serious) > 1:
        raise SeveralArmsError(tree.file, serious)
    aside = tuple(arm.tip for arm in arms[1:])
    return _without_mimics(
        tree, UrdfArm(longest.base, longest.tip, longest.joints, longest.gripper, aside)
    )


def arms_of(tree: UrdfTree, base: str | None) -> list[UrdfArm]:
    """Return every chain of driven joints that ends at a gripper or at its last link.

    The longest is first. A gripper begins where, behind at least three joints, several chains hang
    on one body, all shorter than the arm, or one whose joint is called gripper, finger or jaw.
    """
    arms: dict[str, UrdfArm] = {}
    for root in (base,) if base is not None else tree.roots:
        waiting: list[tuple[str, tuple[UrdfJoint, ...]]] = [(root, ())]
        while waiting:
            link, chain = waiting.pop(0)
            moving = _moving_on(tree, link)
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
    """Return where the moving joints that are not the arm's stand, by name [rad or m].

    Each stands within its limits, as close to zero as they allow; one that mimics another stands
    where that one puts it.

    Raises:
        ConfigError: A joint that follows one of the arm's carries mass: its link is part of no link
            of the arm.
    """
    driven = {joint.name for joint in arm.joints}
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
        if follows and (mass_kg := _mass_behind(tree, joint.child)) > 0.0:
            problems.append(
                f"{joint.where}: joint {joint.name!r} mimics {leader.name!r}, a joint of the arm,"
                f" and carries {mass_kg:g} kg: a link that moves with another joint cannot be part"
                " of the model. Remove <mimic> if the joint has a motor of its own; else take the"
                " <inertial> off its links, whose weight then counts nowhere"
            )
    if problems:
        raise ConfigError("\n".join(problems), code="RID-URDF-MIMIC")
    return {
        joint.name: position(joint)
        for joint in tree.joints
        if joint.kind in MOVING and joint.name not in driven
    }


def _mass_behind(tree: UrdfTree, link: str) -> float:
    """Return the mass of a link and of all that hangs on it [kg]."""
    inertial = tree.links[link].inertial
    own = inertial.mass_kg if inertial is not None else 0.0
    below = tree.joints_below.get(link, ())
    return own + sum(_mass_behind(tree, joint.child) for joint in below)


def _moving_on(tree: UrdfTree, link: str) -> list[UrdfJoint]:
    """Return the joints that move on a body: a link and what is fixed to it.

    What hangs on a joint that is left at zero (of a kind that no motor drives) belongs to the body.
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
    """Return whether a driven joint hangs behind a joint."""
    behind = tree.joints_below.get(joint.child, ())
    return any(each.is_driven or _drives_behind(tree, each) for each in behind)


def _depth(tree: UrdfTree, link: str) -> int:
    """Return how many joints move behind a link, along the longest chain."""
    depth, level = -1, [link]
    while level:
        depth += 1
        level = [joint.child for above in level for joint in _moving_on(tree, above)]
    return depth


def _is_serious(arm: UrdfArm, longest: UrdfArm) -> bool:
    """Return whether an arm may be meant as much as the longest one."""
    shared = sum(a is b for a, b in zip(arm.joints, longest.joints, strict=False))
    own, others = len(arm.joints) - shared, len(longest.joints) - shared
    return own >= min(SHORTEST_ARM, others) and 2 * own >= others


def _without_mimics(tree: UrdfTree, arm: UrdfArm) -> UrdfArm:
    """Return the arm, where no joint before its last one moves as another does.

    Raises:
        ConfigError: One does.
    """
    path = tree.path(arm.base, arm.tip)
    last = path.index(arm.joints[-1])
    lines = [
        f"{joint.where}: joint {joint.name!r} mimics {joint.mimic.joint!r} in the middle of the"
        " arm: a motor that turns two joints of the chain cannot be identified here. Give --tip"
        f" {joint.parent} for the arm before it, or remove <mimic> if the joint has a motor"
        for joint in path[:last]
        if joint.mimic is not None
    ]
    if lines:
        raise ConfigError("\n".join(lines), code="RID-URDF-MIMIC")
    return arm
