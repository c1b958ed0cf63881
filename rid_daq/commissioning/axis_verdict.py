"""What a person saw of an axis, held against what it was told; and the line of a file to change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from rid_daq.commissioning.axis_motion import AxisMotion

SAME: Final = 1.5
"""By which factor an angle by eye may be off, and a velocity at which friction sticks and slips."""

FOLLOWED: Final = 0.3
"""By which share the drive's position may be off the set-point's way."""


@dataclass(frozen=True)
class Seen:
    """What turned, and how far.

    Attributes
    ----------
    joint : str
        The joint that turned; empty where none did.
    amount : float
        How far, positive as the robot file's axis, in the unit of the motion.
    """

    joint: str
    amount: float = 0.0


@dataclass(frozen=True)
class AxisVerdict:
    """Whether an axis does what the files say.

    Attributes
    ----------
    motion : AxisMotion
        What its drive did.
    seen : Seen
        What a person saw.
    problems : tuple of str
        What is wrong, one sentence each with the line to change; none where all is well.
    """

    motion: AxisMotion
    seen: Seen
    problems: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether all is well."""
        return not self.problems

    @property
    def sentence(self) -> str:
        """The verdict on the axis."""
        motion = self.motion
        if self.problems:
            return f"{motion.joint}: {' '.join(self.problems)}"
        encoder = ""
        if motion.increments_per_rev is not None:
            encoder = f", {motion.increments_per_rev:.0f} a revolution of the motor"
        return (
            f"{motion.joint}: direction and gear are right; told"
            f" {motion.said(motion.commanded)}, its drive measured {motion.said(motion.measured)}"
            f" ({motion.counts:+d} increments{encoder})."
        )


def judge_axis(
    motion: AxisMotion, seen: Seen, cell: CellConfig, robot: RobotDescription
) -> AxisVerdict:
    """Judge an axis by its drive and by what was seen."""
    number = robot.joint_names.index(motion.joint)
    problems = [*_of_the_drive(motion, cell, number), *_of_the_eyes(motion, seen, cell, robot)]
    return AxisVerdict(motion, seen, tuple(problems))


def _of_the_drive(motion: AxisMotion, cell: CellConfig, number: int) -> list[str]:
    off = abs(motion.measured - motion.commanded)
    if off > FOLLOWED * abs(motion.commanded):
        return [
            f"its drive was told {motion.said(motion.commanded)} and measured"
            f" {motion.said(motion.measured)}: check the drive's velocity loop, its brake and"
            " position_gain_per_s."
        ]
    if not 1.0 / SAME <= motion.command_share <= SAME:
        return [
            f"its drive moves {1.0 / motion.command_share:.2g} times as fast as it is told: check"
            f" velocity_unit of the axis (cell file; it is {cell.axes[number].velocity_unit}) and"
            " the encoder's resolution in the drive (608Fh)."
        ]
    return []


def _of_the_eyes(
    motion: AxisMotion, seen: Seen, cell: CellConfig, robot: RobotDescription
) -> list[str]:
    number = robot.joint_names.index(motion.joint)
    axis = cell.axes[number]
    if not seen.joint or seen.amount == 0.0:
        return [
            f"its drive counted {motion.counts:+d} increments and nothing turned: check that node"
            f" {axis.node_id} is this axis's drive, its coupling and its gear."
        ]
    if seen.joint != motion.joint:
        other = next(each for each in cell.axes if each.joint == seen.joint)
        return [
            f"{seen.joint} turned in its place. Change in the cell file: axes, {seen.joint}:"
            f" node_id: {axis.node_id} (is {other.node_id}); and see which drive moves"
            f" {motion.joint}."
        ]
    problems = []
    share = seen.amount / motion.commanded
    if share < 0.0:
        problems.append(
            "it turns the other way. Change in the cell file: axes,"
            f" {motion.joint}: direction: {-axis.direction} (is {axis.direction})."
        )
    if not 1.0 / SAME <= abs(share) <= SAME:
        gear = robot.joints[number].gear_ratio
        problems.append(
            f"it moved by {motion.size(seen.amount)} where {motion.size(motion.commanded)} were"
            f" told. Change in the robot file: joints, {motion.joint}:"
            f" gear_ratio: {gear / abs(share):.4g} (is {gear:g}), or the encoder's resolution in"
            " the drive (608Fh)."
        )
    return problems


def parse_amount(text: str, motion: AxisMotion, tool_mm: float) -> float:
    """Return how far an axis moved by a person's word, in the unit of the motion, unsigned.

    Parameters
    ----------
    text : str
        A number, in the unit of the motion; or how far the tool point went, as "24mm".
    motion : AxisMotion
        What was commanded.
    tool_mm : float
        How far the tool point would have gone then [mm].

    Raises
    ------
    ConfigError
        It is no such number.
    """
    words = text.strip().lower().replace(",", ".")
    of_tool = words.endswith("mm") and motion.unit == "°"
    try:
        value = float(words.removesuffix("mm").removesuffix("°").removesuffix("deg").strip())
    except ValueError:
        raise ConfigError(
            f"{text!r}: give a number, such as 2, or 24mm of the tool point"
        ) from None
    if not 0.0 <= value < 1e4:
        raise ConfigError(f"{text!r}: give how far it moved, without a sign")
    if not of_tool:
        return value
    if tool_mm <= 0.0:
        raise ConfigError(f"{text!r}: the tool point stands on this axis: give degrees")
    return value / tool_mm * abs(motion.commanded)
