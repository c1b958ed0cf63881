"""Limits of a payload that follow from the robot: largest plausible mass, negligible errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from config.errors import LimitError
from config.robot.robot import RobotDescription

TOO_HEAVY: Final = "RID-PAYLOAD-HEAVY"
NEGLIGIBLE_SHARE: Final = 0.005
"""Errors of a payload that change a joint's torque by less than this fraction of its limit, or the
mass by less than this fraction of the rated payload, are negligible for the robot.
"""


@dataclass(frozen=True)
class HeaviestPayload:
    """Mass above which a payload is implausible [kg], and the source of this limit."""

    mass_kg: float
    source: str

    @classmethod
    def of(cls, robot: RobotDescription) -> HeaviestPayload | None:
        """Return a robot's rated payload, or else the mass of its links from its drawings.

        None if the robot file has neither. Robot arms usually carry less than their own mass.
        """
        if robot.rated_payload_kg is not None:
            return cls(robot.rated_payload_kg, "the robot's rated payload")
        if robot.cad is None or not robot.is_drawn:
            return None
        return cls(sum(link.mass_kg for link in robot.cad), "the arm's own mass from its drawings")


@dataclass(frozen=True)
class NegligibleErrors:
    """Absolute limits of a verdict below which an error does not matter to the robot.

    They are alternatives to limits in percent, which a light tool cannot satisfy.

    Attributes:
        mass_kg: Fraction `NEGLIGIBLE_SHARE` of the rated payload [kg]; None if it is not stated.
        inertia_kg_m2: Inertia that needs the fraction `NEGLIGIBLE_SHARE` of the torque limit at the
            acceleration limit, for the weakest revolute joint [kg m²]; None without such a joint.
        residual_nm: Fraction `NEGLIGIBLE_SHARE` of the torque limit of the weakest revolute joint
            [N m]; None without such a joint.
    """

    mass_kg: float | None
    inertia_kg_m2: float | None
    residual_nm: float | None

    @classmethod
    def of(cls, robot: RobotDescription) -> NegligibleErrors:
        """Return the negligible errors of a payload on a robot."""
        rated, share = robot.rated_payload_kg, NEGLIGIBLE_SHARE
        turning = [joint.limits for joint in robot.joints if joint.type == "revolute"]
        return cls(
            None if rated is None else share * rated,
            min((share * each.torque / each.acceleration for each in turning), default=None),
            min((share * each.torque for each in turning), default=None),
        )


def refuse_heavier(robot: RobotDescription, mass_kg: float) -> None:
    """Refuse to move a payload whose stated mass exceeds the robot's largest plausible payload.

    Raises:
        LimitError: The payload is too heavy.
    """
    heaviest = HeaviestPayload.of(robot)
    if heaviest is not None and mass_kg > heaviest.mass_kg:
        raise LimitError(
            f"a payload of {mass_kg:g} kg is heavier than {heaviest.source},"
            f" {heaviest.mass_kg:.4g} kg: correct the mass, or set rated_payload_kg in the robot"
            " file",
            code=TOO_HEAVY,
        )
