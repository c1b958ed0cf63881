"""`KnownPose`: last known pose of the robot, to detect a lost encoder zero before a motion.

A multi-turn encoder that has lost its count after a power cycle is wrong by whole turns of its
motor; all later positions look plausible. A comparison with the last pose detects this.
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
"""Largest accepted displacement of a revolute joint, which the play of a brake can cause [rad]."""

LEAST_M: Final = 2e-3
"""Largest accepted displacement of a prismatic joint [m]."""

_SHARE_OF_TURN: Final = 0.25
_WHOLE_TURNS: Final = 0.02
_MOST_NAMED: Final = 3


@dataclass(frozen=True)
class KnownPose:
    """Last known pose of a robot.

    Attributes:
        position: Position of each joint [rad or m].
        source: Source and time of the pose, as "run 01M8... (2026-11-26T15:04:05+00:00)".
        binding: True to refuse a motion if the robot is elsewhere; False to add only a note.
    """

    position: tuple[float, ...]
    source: str
    binding: bool = True

    def displacements(self, robot: RobotDescription, position: Sequence[float]) -> list[str]:
        """Return a phrase for each displaced joint; empty if no joint is displaced.

        Args:
            robot: The joints.
            position: Present joint positions [rad or m].
        """
        found = []
        for joint, now, then in zip(robot.joints, position, self.position, strict=True):
            moved = now - then
            if abs(moved) > displacement_limit(joint):
                found.append(f"{joint.name} by {_describe_displacement(joint, moved)}")
        return found

    def sentence(self, moved: Sequence[str]) -> str:
        """Return a sentence that names the displaced joints."""
        shown = ", ".join(moved[:_MOST_NAMED])
        more = len(moved) - _MOST_NAMED
        others = f" and {more} more" if more > 0 else ""
        return f"the robot is not at the pose in which {self.source} left it: {shown}{others}"

    def refuse_moved(self, robot: RobotDescription, position: Sequence[float]) -> str:
        """Raise an error if a joint is not at its last known position and the pose is binding.

        Returns:
            A note if the pose is not binding and a joint is displaced; otherwise empty.

        Raises:
            PreflightError: The pose is binding and a joint is displaced.
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
    """Return the largest displacement that is accepted [rad or m].

    It is at most a quarter of a turn of the motor, so that a lost turn is detected.
    """
    least = LEAST_M if joint.type == "prismatic" else LEAST_RAD
    return min(least, _SHARE_OF_TURN * _motor_turn(joint))


def _motor_turn(joint: Joint) -> float:
    """Return the displacement of a joint for one turn of its motor [rad or m]."""
    return 2.0 * math.pi / abs(joint.gear_ratio)


def _describe_displacement(joint: Joint, moved: float) -> str:
    words = f"{1e3 * moved:.1f} mm" if joint.type == "prismatic" else f"{math.degrees(moved):.2f}°"
    turns = moved / _motor_turn(joint)
    if round(turns) and abs(turns - round(turns)) <= _WHOLE_TURNS * abs(turns):
        count = abs(round(turns))
        words += f" ({count} whole motor turn{'s' if count > 1 else ''})"
    return words
