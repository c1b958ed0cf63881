"""How heavy a payload a robot can carry: its rating, or the weight of its own links."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from config.errors import LimitError
from config.robot.robot import RobotDescription

TOO_HEAVY: Final = "RID-PAYLOAD-HEAVY"


@dataclass(frozen=True)
class HeaviestPayload:
    """The mass beyond which a payload is doubtful [kg], and what says so."""

    mass_kg: float
    source: str

    @classmethod
    def of(cls, robot: RobotDescription) -> HeaviestPayload | None:
        """Return a robot's rated payload, else the mass of its links by its drawings.

        None if the robot file has neither. Arms carry less than they weigh.
        """
        if robot.rated_payload_kg is not None:
            return cls(robot.rated_payload_kg, "the robot's rated payload")
        if robot.cad is None or not robot.is_drawn:
            return None
        return cls(sum(link.mass_kg for link in robot.cad), "the arm's own mass by its drawings")


def refuse_heavier(robot: RobotDescription, mass_kg: float) -> None:
    """Refuse to move a payload that is said to be heavier than the robot can carry.

    Raises:
        LimitError: It is.
    """
    heaviest = HeaviestPayload.of(robot)
    if heaviest is not None and mass_kg > heaviest.mass_kg:
        raise LimitError(
            f"a payload of {mass_kg:g} kg is heavier than {heaviest.source},"
            f" {heaviest.mass_kg:.4g} kg: correct it, or state rated_payload_kg in the robot file",
            code=TOO_HEAVY,
        )
