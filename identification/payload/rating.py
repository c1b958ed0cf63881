"""Largest plausible payload of a robot: its rated payload, or the mass of its own links."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from config.errors import LimitError
from config.robot.robot import RobotDescription

TOO_HEAVY: Final = "RID-PAYLOAD-HEAVY"


@dataclass(frozen=True)
class HeaviestPayload:
    """Mass above which a payload is implausible [kg], and the source of this limit."""

    mass_kg: float
    source: str

    @classmethod
    def of(cls, robot: RobotDescription) -> HeaviestPayload | None:
        """Return a robot's rated payload, or else the mass of its links from its drawings.

        None if the robot file has neither. Robot arms carry less than their own mass.
        """
        if robot.rated_payload_kg is not None:
            return cls(robot.rated_payload_kg, "the robot's rated payload")
        if robot.cad is None or not robot.is_drawn:
            return None
        return cls(sum(link.mass_kg for link in robot.cad), "the arm's own mass from its drawings")


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
