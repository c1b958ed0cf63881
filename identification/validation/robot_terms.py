"""Robot descriptions with other friction terms."""

from __future__ import annotations

from collections.abc import Sequence

from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription

Terms = tuple[FrictionTerm, ...]
"""Friction terms of one joint."""


def with_friction(robot: RobotDescription, terms: Sequence[Terms]) -> RobotDescription:
    """Return a robot whose joints have these friction terms, one tuple per joint."""
    joints = (
        joint.model_copy(
            update={"friction": own, "efficiency": None if "load" in own else joint.efficiency}
        )
        for joint, own in zip(robot.joints, terms, strict=True)
    )
    return robot.model_copy(update={"joints": tuple(joints)})


def with_stribeck(robot: RobotDescription, speeds: Sequence[float | None]) -> RobotDescription:
    """Return a robot with Stribeck friction on exactly the joints that have a speed."""
    joints = []
    for joint, speed in zip(robot.joints, speeds, strict=True):
        friction = tuple(term for term in joint.friction if term != "stribeck")
        update: dict[str, object] = {"friction": friction}
        if speed is not None:
            update = {"friction": (*friction, "stribeck"), "stribeck_velocity": speed}
        joints.append(joint.model_copy(update=update))
    return robot.model_copy(update={"joints": tuple(joints)})


def with_shear_thinning(
    robot: RobotDescription, speeds: Sequence[float | None]
) -> RobotDescription:
    """Return a robot with shear-thinning friction on exactly the joints that have a speed."""
    joints = []
    for joint, speed in zip(robot.joints, speeds, strict=True):
        friction = tuple(term for term in joint.friction if term != "shear_thinning")
        update: dict[str, object] = {"friction": friction}
        if speed is not None:
            update = {"friction": (*friction, "shear_thinning"), "shear_thinning_velocity": speed}
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
