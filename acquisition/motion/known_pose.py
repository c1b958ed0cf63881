"""`KnownPose`: where the last run left the robot, to tell a lost zero before the next motion.

A multi-turn encoder that has lost its count after a power cycle is wrong by whole turns of its
motor; every position after it looks plausible. Only a comparison with the last pose shows it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from config.errors import PreflightError
from config.robot.robot import Joint, RobotDescription

MOVED: Final = "RID-POSE-MOVED"

LEAST_RAD: Final = 0.01
"""A joint that has moved less may have sagged into its brake [rad]."""

LEAST_M: Final = 2e-3
"""The same for a prismatic joint [m]."""

_SHARE_OF_TURN: Final = 0.25
_WHOLE_TURNS: Final = 0.02
_MOST_NAMED: Final = 3


@dataclass(frozen=True)
class KnownPose:
    """Where a robot stood when it was last seen.

    Attributes:
        position: Length joints. Of the joints [rad or m].
        seen: By what and when, as "run 01M8... (2026-11-26T15:04:05+00:00)".
        binding: Whether a motion is refused if the robot stands elsewhere; otherwise it is noted.
    """

    position: tuple[float, ...]
    seen: str
    binding: bool = True

    def displacements(self, robot: RobotDescription, position: Sequence[float]) -> list[str]:
        """Return a phrase for each joint that stands elsewhere, empty if none does.

        Args:
            robot: The joints.
            position: Where they stand now [rad or m].
        """
        found = []
        for joint, now, then in zip(robot.joints, position, self.position, strict=True):
            moved = now - then
            if abs(moved) > displacement_limit(joint):
                found.append(f"{joint.name} by {_in_words(joint, moved)}")
        return found

    def sentence(self, moved: Sequence[str]) -> str:
        """Return which joints stand elsewhere than they were seen, in a sentence."""
        shown = ", ".join(moved[:_MOST_NAMED])
        more = len(moved) - _MOST_NAMED
        others = f" and {more} more" if more > 0 else ""
        return f"the robot stands elsewhere than where {self.seen} left it: {shown}{others}"

    def refuse_moved(self, robot: RobotDescription, position: Sequence[float]) -> str:
        """Refuse a motion if a joint stands elsewhere than it was seen last.

        Returns:
            A note if the pose is not binding and a joint stands elsewhere; otherwise empty.

        Raises:
            PreflightError: The pose is binding and a joint stands elsewhere.
        """
        moved = self.displacements(robot, position)
        if not moved:
            return ""
        if not self.binding:
            return self.sentence(moved)
        raise PreflightError(f"{self.sentence(moved)}; {ADVICE}; nothing was moved", code=MOVED)


ADVICE: Final = (
    "compare each joint with its mark. If the positions are right, confirm them with"
    " `rid-daq check CELL --accept-pose`; if not, restore the drive's zero or correct"
    " position_zero_counts"
)


def displacement_limit(joint: Joint) -> float:
    """Return by how much a joint may stand elsewhere [rad or m].

    It is less than a turn of the motor, so that a lost turn is always seen.
    """
    least = LEAST_M if joint.type == "prismatic" else LEAST_RAD
    return min(least, _SHARE_OF_TURN * _turn(joint))


def _turn(joint: Joint) -> float:
    """Return how far a turn of the motor moves a joint [rad or m]."""
    return 2.0 * math.pi / abs(joint.gear_ratio)


def _in_words(joint: Joint, moved: float) -> str:
    words = f"{1e3 * moved:.1f} mm" if joint.type == "prismatic" else f"{math.degrees(moved):.2f}°"
    turns = moved / _turn(joint)
    if round(turns) and abs(turns - round(turns)) <= _WHOLE_TURNS * abs(turns):
        count = abs(round(turns))
        words += f" ({count} whole motor turn{'s' if count > 1 else ''})"
    return words
