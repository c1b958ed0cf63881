"""What a URDF says of gears, friction and rotors, and where each of it goes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

from config.errors import ConfigError
from config.formats.urdf import UrdfJoint, UrdfTree
from config.robot.robot import JointLimits
from config.robot.urdf_chain import UrdfArm
from config.robot.urdf_limits import Taken

Direction = Literal[1, -1]
RATIOS: Final = (0.05, 5e3)
FRICTION_SHARE: Final = 0.6
"""Share of a torque limit that friction may take in the simulation, at the velocity limit."""


@dataclass(frozen=True)
class UrdfMotor:
    """Friction at the joint, and which way the motor turns.

    Attributes:
        coulomb, viscous: Friction [N m or N, N m s/rad or N s/m]; None if the plant must invent it.
        direction: -1 if the motor turns against its joint: the URDF's reduction is negative.
    """

    coulomb: float | None
    viscous: float | None
    direction: Direction


def motors_of_urdf(
    tree: UrdfTree, arm: UrdfArm, limits: Sequence[JointLimits]
) -> tuple[list[float], tuple[UrdfMotor, ...], list[list[Taken]]]:
    """Return the joints' gear ratios, their motors, and what to say of them at each joint.

    Args:
        tree: The URDF.
        arm: The joints.
        limits: Their limits.

    Raises:
        ConfigError: A reduction is none that a joint has.
    """
    ratios: list[float] = []
    motors: list[UrdfMotor] = []
    taken: list[list[Taken]] = []
    for joint, limit in zip(arm.joints, limits, strict=True):
        told: list[Taken] = []
        ratio = tree.gear_ratios.get(joint.name, 1.0)
        unread = tree.unread_ratios.get(joint.name)
        if not RATIOS[0] <= abs(ratio) <= RATIOS[1]:
            raise ConfigError(
                f"{joint.where}: joint {joint.name!r} has a reduction of {ratio:g}; expected is"
                f" {RATIOS[0]:g} to {RATIOS[1]:g}, motor turns per joint turn",
                code="RID-URDF-GEAR",
            )
        if unread is not None:
            how = f"default: the URDF's reduction {unread!r} is no ratio of one joint"
            told.append(Taken("gear_ratio", "1", how))
        if ratio < 0.0:
            how = f"the URDF's reduction is {ratio:g}: direction -1 in cell.yaml has the sign"
            told.append(Taken("gear_ratio", f"{-ratio:g}", how))
        coulomb, viscous = _friction(joint, limit, told)
        ratios.append(abs(ratio))
        motors.append(UrdfMotor(coulomb, viscous, -1 if ratio < 0.0 else 1))
        if joint.rotor_inertia_kg_m2:
            how = (
                "the URDF's rotor, before the gear; plant.yaml invents one that its loops need, and"
                " identify estimates the real one: compare"
            )
            told.append(Taken("rotor_inertia", f"{joint.rotor_inertia_kg_m2:g} kg m²", how))
        taken.append(told)
    return ratios, tuple(motors), taken


def _friction(
    joint: UrdfJoint, limits: JointLimits, told: list[Taken]
) -> tuple[float | None, float | None]:
    """Return Coulomb and viscous friction for the plant; None if it must invent them."""
    coulomb, viscous = joint.friction or 0.0, joint.damping or 0.0
    if coulomb == viscous == 0.0:
        return None, None
    fits = coulomb + viscous * limits.velocity <= FRICTION_SHARE * limits.torque
    where = (
        "the URDF's <dynamics>: simulated in plant.yaml; identify estimates it anew"
        if fits
        else "the URDF's <dynamics>: more than the motor turns at its velocity limit, so that"
        " plant.yaml invents another; is it in another unit?"
    )
    told.append(Taken("friction", f"{coulomb:g} + {viscous:g} per speed", where))
    return (coulomb, viscous) if fits else (None, None)
