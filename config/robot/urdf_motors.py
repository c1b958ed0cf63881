"""Gears, friction and rotors from a URDF, and the files to which they are written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from config.errors import ConfigError
from config.formats.urdf import UrdfJoint, UrdfTree
from config.quantities import Direction
from config.robot.robot import JointLimits
from config.robot.urdf_chain import UrdfArm
from config.robot.urdf_limits import ReplacedValue

RATIOS: Final = (0.05, 5e3)
FRICTION_SHARE: Final = 0.6
"""Largest friction in the simulation at the velocity limit, as a fraction of the torque limit."""


@dataclass(frozen=True)
class UrdfMotor:
    """Friction at the joint, and the motor's direction of rotation.

    Attributes:
        coulomb, viscous: Friction [N m or N, N m s/rad or N s/m]; None if assumed.
        direction: -1 if the motor turns against its joint, that is, if the URDF's reduction is
            negative.
    """

    coulomb: float | None
    viscous: float | None
    direction: Direction


def motors_of_urdf(
    tree: UrdfTree, arm: UrdfArm, limits: Sequence[JointLimits]
) -> tuple[list[float], tuple[UrdfMotor, ...], list[list[ReplacedValue]]]:
    """Return the joints' gear ratios, their motors, and the values that differ from the URDF.

    Raises:
        ConfigError: A reduction is outside the range of real joints.
    """
    ratios: list[float] = []
    motors: list[UrdfMotor] = []
    replaced: list[list[ReplacedValue]] = []
    for joint, limit in zip(arm.joints, limits, strict=True):
        replaced_here: list[ReplacedValue] = []
        ratio = tree.gear_ratios.get(joint.name, 1.0)
        unread = tree.unread_ratios.get(joint.name)
        if not RATIOS[0] <= abs(ratio) <= RATIOS[1]:
            raise ConfigError(
                f"{joint.where}: joint {joint.name!r} has a reduction of {ratio:g}; expected is"
                f" {RATIOS[0]:g} to {RATIOS[1]:g}, motor turns per joint turn",
                code="RID-URDF-GEAR",
            )
        if unread is not None:
            how = f"default: the URDF's reduction {unread!r} is not the ratio of one joint"
            replaced_here.append(ReplacedValue("gear_ratio", "1", how))
        if ratio < 0.0:
            how = f"the URDF's reduction is {ratio:g}; direction -1 in cell.yaml carries the sign"
            replaced_here.append(ReplacedValue("gear_ratio", f"{-ratio:g}", how))
        coulomb, viscous = _friction(joint, limit, replaced_here)
        ratios.append(abs(ratio))
        motors.append(UrdfMotor(coulomb, viscous, -1 if ratio < 0.0 else 1))
        if joint.rotor_inertia_kg_m2:
            how = (
                "the URDF's rotor, before the gear; plant.yaml contains an assumed one that suits"
                " its control loops, and identify estimates the real one: compare them"
            )
            replaced_here.append(
                ReplacedValue("rotor_inertia", f"{joint.rotor_inertia_kg_m2:g} kg m²", how)
            )
        replaced.append(replaced_here)
    return ratios, tuple(motors), replaced


def _friction(
    joint: UrdfJoint, limits: JointLimits, replaced_here: list[ReplacedValue]
) -> tuple[float | None, float | None]:
    """Return Coulomb and viscous friction for the plant; None if the plant needs assumed values."""
    coulomb, viscous = joint.friction or 0.0, joint.damping or 0.0
    if coulomb == viscous == 0.0:
        return None, None
    fits = coulomb + viscous * limits.velocity <= FRICTION_SHARE * limits.torque
    where = (
        "the URDF's <dynamics>: simulated in plant.yaml; identify estimates it independently"
        if fits
        else "the URDF's <dynamics>: more than the motor's torque allows at its velocity limit;"
        " plant.yaml contains an assumed one; is the URDF's value in another unit?"
    )
    replaced_here.append(ReplacedValue("friction", f"{coulomb:g} + {viscous:g} per speed", where))
    return (coulomb, viscous) if fits else (None, None)
