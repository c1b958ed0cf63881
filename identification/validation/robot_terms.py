"""Robot descriptions with other friction terms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription

Terms = tuple[FrictionTerm, ...]
"""Friction terms of one joint."""


def with_friction(robot: RobotDescription, terms: Sequence[Terms]) -> RobotDescription:
    """Return a robot whose joints have these friction terms, one tuple per joint.

    A joint with the term `load` loses its stated gear efficiency.
    """
    joints = (
        joint.model_copy(
            update={"friction": own, "efficiency": None if "load" in own else joint.efficiency}
        )
        for joint, own in zip(robot.joints, terms, strict=True)
    )
    return robot.model_copy(update={"joints": tuple(joints)})


def with_speeds(
    robot: RobotDescription,
    term: Literal["stribeck", "shear_thinning"],
    speeds: Sequence[float | None],
) -> RobotDescription:
    """Return a robot with a friction term on exactly the joints that have a speed for it."""
    joints = []
    for joint, speed in zip(robot.joints, speeds, strict=True):
        friction = tuple(each for each in joint.friction if each != term)
        update: dict[str, object] = {"friction": friction}
        if speed is not None:
            update = {"friction": (*friction, term), f"{term}_velocity": speed}
        joints.append(joint.model_copy(update=update))
    return robot.model_copy(update={"joints": tuple(joints)})


def with_presliding(
    robot: RobotDescription,
    distances: Sequence[float | None],
    shares: Sequence[float] | None = None,
) -> RobotDescription:
    """Return a robot with presliding on exactly the joints that have a distance [rad or m].

    Args:
        distances: Presliding distance of each joint, or None.
        shares: Presliding fraction of each joint's friction; 1 by default.
    """
    joints = []
    shares = shares or [1.0] * len(distances)
    for joint, distance, share in zip(robot.joints, distances, shares, strict=True):
        friction = tuple(term for term in joint.friction if term != "presliding")
        update: dict[str, object] = {"friction": friction}
        if distance is not None:
            update = {
                "friction": (*friction, "presliding"),
                "presliding_distance": distance,
                "presliding_share": share,
            }
        joints.append(joint.model_copy(update=update))
    return robot.model_copy(update={"joints": tuple(joints)})
