"""What a person saw of an axis, held against what it was told; and the line of a file to change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from config.cell.cell import CellConfig, DriveAxis
from config.cell.servo_profile import ServoProfile
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

    Attributes:
        joint: The joint that turned; empty where none did.
        amount: How far, positive as the robot file's axis, in the unit of the motion.
    """

    joint: str
    amount: float = 0.0


@dataclass(frozen=True)
class AxisVerdict:
    """Whether an axis does what the files say.

    Attributes:
        motion: What its drive did.
        seen: What a person saw.
        problems: What is wrong, one sentence each with the line to change; none where all is well.
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
    """Judge an axis by its drive and by what was seen.

    Note:
        Three wrong numbers can be told apart, since each scales other ratios. Of the commanded
        velocity over the drive's own position, and of the seen motion over that position: a wrong
        velocity unit scales only the first, a wrong gear ratio only the second, a wrong encoder
        resolution both alike (only the second if velocities are in increments).
    """
    problems = _of_the_axis(motion, seen, cell)
    if not problems:
        problems = [*_of_the_direction(motion, seen, cell)]
        problems += _of_the_scales(motion, seen, cell, robot)
    return AxisVerdict(motion, seen, tuple(problems))


def _same(share: float) -> bool:
    return 1.0 / SAME <= share <= SAME


def _axis_of(motion: AxisMotion, cell: CellConfig) -> DriveAxis:
    return next(each for each in cell.axes if each.joint == motion.joint)


def _of_the_axis(motion: AxisMotion, seen: Seen, cell: CellConfig) -> list[str]:
    """Return that nothing turned, or another joint."""
    axis = _axis_of(motion, cell)
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
    return []


def _of_the_direction(motion: AxisMotion, seen: Seen, cell: CellConfig) -> list[str]:
    if seen.amount * motion.commanded > 0.0:
        return []
    direction = _axis_of(motion, cell).direction
    return [
        "it turns the other way. Change in the cell file: axes,"
        f" {motion.joint}: direction: {-direction} (is {direction})."
    ]


def _of_the_scales(
    motion: AxisMotion, seen: Seen, cell: CellConfig, robot: RobotDescription
) -> list[str]:
    """Return which number of the files explains how far command, drive and eyes are apart."""
    axis = _axis_of(motion, cell)
    servo = cell.servo_of(axis)
    where = f"Change in the cell file: axes, {motion.joint}, servo:"
    if motion.measured == 0.0:
        return ["its drive counted nothing while it turned: check the encoder and 6064h."]
    command = abs(motion.command_share)
    eyes = abs(seen.amount / motion.measured)
    if not _same(command) and _same(eyes):
        units = servo.velocity_units * command
        return [
            f"its drive moves {1.0 / command:.2g} times as fast as it is told. {where}"
            f" velocity_units: {units:.4g} (is {servo.velocity_units:g} {servo.velocity_unit}), or"
            " velocity_unit."
        ]
    if not _same(command) and not _same(eyes / command):
        return [
            f"its drive was told {motion.said(motion.commanded)} and measured"
            f" {motion.said(motion.measured)}; {motion.size(seen.amount)} were seen, and it moves"
            f" {1.0 / command:.2g} times as fast as it is told: check encoder_increments,"
            " velocity_unit and velocity_units of the axis's servo (cell file)."
        ]
    if not _same(eyes):
        return [_of_encoder_or_gear(motion, eyes, servo, robot, where)]
    if abs(motion.measured - motion.commanded) > FOLLOWED * abs(motion.commanded):
        return [
            f"its drive was told {motion.said(motion.commanded)} and measured"
            f" {motion.said(motion.measured)}: check the drive's velocity loop, its brake and"
            " position_gain_per_s."
        ]
    return []


def _of_encoder_or_gear(
    motion: AxisMotion, eyes: float, servo: ServoProfile, robot: RobotDescription, where: str
) -> str:
    """Return what to change if more, or less, was seen than the drive measured.

    The gear ratio is accused only if the drive itself says what its encoder has (608Fh).
    """
    looked = motion.size(eyes * motion.measured)
    found = f"its drive measured {motion.size(motion.measured)}, and {looked} were seen."
    if servo.encoder_increments is not None:
        return (
            f"{found} {where} encoder_increments: {servo.encoder_increments / eyes:.4g} (is"
            f" {servo.encoder_increments:g}), by the encoder's data sheet. If the data sheet says"
            f" {servo.encoder_increments:g}, check the gear."
        )
    joint = robot.joints[robot.joint_names.index(motion.joint)]
    if not _same(abs(motion.command_share)):
        return (
            f"{found} The encoder's resolution in the drive (608Fh) is {eyes:.3g} times the true"
            " one: correct it in the drive's own tool."
        )
    return (
        f"{found} Change in the robot file: joints, {motion.joint}: gear_ratio:"
        f" {joint.gear_ratio / eyes:.4g} (is {joint.gear_ratio:g}), or the encoder's resolution in"
        " the drive (608Fh)."
    )


def parse_amount(text: str, motion: AxisMotion, tool_mm: float) -> float:
    """Return how far an axis moved by a person's word, in the unit of the motion, unsigned.

    Args:
        text: A number, in the unit of the motion; or how far the tool point went, as "24mm".
        motion: What was commanded.
        tool_mm: How far the tool point would have gone then [mm].

    Raises:
        ConfigError: It is no such number.
    """
    words = text.strip().lower().replace(",", ".")
    of_tool = words.endswith("mm") and motion.unit == "°"
    try:
        value = float(words.removesuffix("mm").removesuffix("°").removesuffix("deg").strip())
    except ValueError:
        raise ConfigError(
            f"{text!r}: give a number, such as 2, or 24mm of the tool point",
            code="RID-AXIS-TEST-ANSWER",
        ) from None
    if not 0.0 <= value < 1e4:
        raise ConfigError(
            f"{text!r}: give how far it moved, without a sign", code="RID-AXIS-TEST-ANSWER"
        )
    if not of_tool:
        return value
    if tool_mm <= 0.0:
        raise ConfigError(
            f"{text!r}: the tool point stands on this axis: give degrees",
            code="RID-AXIS-TEST-ANSWER",
        )
    return value / tool_mm * abs(motion.commanded)
