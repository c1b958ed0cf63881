"""Verdict of the axis test: compare the commanded, the measured and the observed motion.

The drive measures the motion, and a person observes it. A failed verdict says what to check, or
which line of the cell file or robot file to change.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from config.cell.cell import CellConfig, DriveAxis
from config.cell.servo_profile import ServoProfile
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from rid_daq.commissioning.axis_motion import AxisMotion

AGREEMENT_FACTOR: Final = 1.5
"""Largest ratio of two displacements that count as equal: a person estimates one by eye, and the
joint may stick and slip.
"""

TORQUE_CODE: Final = "RID-AXIS-TORQUE"
LARGEST_DEVIATION: Final = 0.3
"""Largest accepted deviation of the measured from the commanded displacement, as a fraction."""


@dataclass(frozen=True)
class ObservedMotion:
    """Motion that a person saw.

    Attributes:
        joint: Joint that moved; empty if no joint moved.
        amount: Displacement in the unit of the motion; positive about the joint's axis in the robot
            file.
    """

    joint: str
    amount: float = 0.0


@dataclass(frozen=True)
class AxisVerdict:
    """Verdict on an axis: the mistakes that its motion shows.

    Attributes:
        motion: Commanded motion, and the motion that the drive has measured.
        observed: Motion that a person saw.
        problems: Mistakes, each with what to check or change; empty if the axis passed.
        code: Code of a wrong torque; empty for other mistakes.
    """

    motion: AxisMotion
    observed: ObservedMotion
    problems: tuple[str, ...]
    code: str = ""

    def with_torque(self, problem: str) -> AxisVerdict:
        """Return the verdict with a problem of the torque, unless the motion itself is wrong."""
        if not problem or self.problems:
            return self
        return replace(self, problems=(f"{problem} [{TORQUE_CODE}].",), code=TORQUE_CODE)

    @property
    def passed(self) -> bool:
        """True if no mistake was found."""
        return not self.problems

    @property
    def sentence(self) -> str:
        """Verdict as a sentence."""
        motion = self.motion
        if self.problems:
            return f"{motion.joint}: {' '.join(self.problems)}"
        encoder = ""
        if motion.increments_per_rev is not None:
            encoder = f", {motion.increments_per_rev:.0f} per revolution of the motor"
        return (
            f"{motion.joint}: direction and gear are correct; commanded"
            f" {motion.signed_text(motion.commanded)}, measured by the drive"
            f" {motion.signed_text(motion.measured)} ({motion.counts:+d} increments{encoder})."
        )


def check_axis_motion(
    motion: AxisMotion, observed: ObservedMotion, cell: CellConfig, robot: RobotDescription
) -> AxisVerdict:
    """Compare commanded, measured and observed motion, and find the wrong entries of the files.

    Note:
        Three numbers in the files can be wrong: velocity unit, gear ratio, encoder resolution. Two
            ratios show which one: R1, the integral of the commanded velocity over the measured
            displacement, and R2, the observed over the measured displacement. A wrong velocity
            unit changes only R1. A wrong gear ratio changes only R2. A wrong encoder resolution
            changes R1 and R2 by the same factor (only R2 if velocities are in increments). A
            drive in a position mode has no velocity unit; its R1 is 1 if it follows its set-points.
    """
    problems = _wrong_joint(motion, observed, cell)
    if not problems:
        problems = [*_wrong_direction(motion, observed, cell)]
        problems += _wrong_scale(motion, observed, cell, robot)
    return AxisVerdict(motion, observed, tuple(problems))


def _is_near_one(ratio: float) -> bool:
    return 1.0 / AGREEMENT_FACTOR <= ratio <= AGREEMENT_FACTOR


def _axis_of(motion: AxisMotion, cell: CellConfig) -> DriveAxis:
    return next(each for each in cell.axes if each.joint == motion.joint)


def _wrong_joint(motion: AxisMotion, observed: ObservedMotion, cell: CellConfig) -> list[str]:
    """Return the problem that no joint moved, or another one; an empty list if neither is so."""
    axis = _axis_of(motion, cell)
    if not observed.joint or observed.amount == 0.0:
        return [
            f"the drive counted {motion.counts:+d} increments, but nothing moved: check that node"
            f" {axis.node_id} is the drive of this axis, and check coupling and gear of the axis."
        ]
    if observed.joint != motion.joint:
        other = next(each for each in cell.axes if each.joint == observed.joint)
        return [
            f"another joint moved: {observed.joint}. Change in the cell file: axes,"
            f" {observed.joint}: node_id: {axis.node_id} (is {other.node_id}); then find the drive"
            f" that moves {motion.joint}."
        ]
    return []


def _wrong_direction(motion: AxisMotion, observed: ObservedMotion, cell: CellConfig) -> list[str]:
    if observed.amount * motion.commanded > 0.0:
        return []
    direction = _axis_of(motion, cell).direction
    return [
        f"the joint moves in the opposite direction. Change in the cell file: axes, {motion.joint}:"
        f" direction: {-direction} (is {direction})."
    ]


def _wrong_scale(
    motion: AxisMotion, observed: ObservedMotion, cell: CellConfig, robot: RobotDescription
) -> list[str]:
    """Return the problem if commanded, measured and observed displacement differ in size.

    If one number in the files explains the difference, the problem names it.
    """
    axis = _axis_of(motion, cell)
    servo = cell.servo_of(axis)
    where = f"Change in the cell file: axes, {motion.joint}, servo:"
    if motion.measured == 0.0:
        return [
            "the drive counted no increments although the joint moved: check the encoder and 6064h."
        ]
    command = abs(motion.command_ratio)
    seen_ratio = abs(observed.amount / motion.measured)
    if servo.by_position and not _is_near_one(command):
        return [
            f"commanded {motion.signed_text(motion.commanded)}, measured by the drive"
            f" {motion.signed_text(motion.measured)}, seen {motion.size_text(observed.amount)}; the"
            " drive receives positions and does not reach them: check that 607Ah and 6064h have the"
            " same unit in the drive, and its position loop and brake."
        ]
    if not _is_near_one(command) and _is_near_one(seen_ratio):
        units = servo.velocity_units * command
        # the axis's own velocity_unit replaces that of its servo profile
        place = f"axes, {motion.joint}{'' if axis.velocity_unit else ', servo'}"
        return [
            f"the drive moves {1.0 / command:.2g} times as fast as commanded. {where}"
            f" velocity_units: {units:.4g} (is {servo.velocity_units:g}); or, if 60FFh of this"
            f" drive is not in {servo.velocity_unit}, correct {place}: velocity_unit."
        ]
    if not _is_near_one(command) and not _is_near_one(seen_ratio / command):
        return [
            f"commanded {motion.signed_text(motion.commanded)}, measured by the drive"
            f" {motion.signed_text(motion.measured)}, seen {motion.size_text(observed.amount)}; the"
            f" drive moves {1.0 / command:.2g} times as fast as commanded: check"
            " encoder_increments, velocity_unit and velocity_units of the axis in the cell file."
        ]
    if not _is_near_one(seen_ratio):
        return [_wrong_encoder_or_gear(motion, seen_ratio, servo, robot, where)]
    if abs(motion.measured - motion.commanded) > LARGEST_DEVIATION * abs(motion.commanded):
        return [
            f"commanded {motion.signed_text(motion.commanded)}, measured by the drive"
            f" {motion.signed_text(motion.measured)}: check the drive's velocity loop, its brake"
            " and position_gain_per_s."
        ]
    return []


def _wrong_encoder_or_gear(
    motion: AxisMotion, seen_ratio: float, servo: ServoProfile, robot: RobotDescription, where: str
) -> str:
    """Return the problem of a wrong encoder resolution or gear ratio.

    `gear_ratio` is named only if the drive itself states its encoder resolution (608Fh) and
    commanded and measured motion agree.
    """
    seen_size = motion.size_text(seen_ratio * motion.measured)
    found = f"measured by the drive {motion.size_text(motion.measured)}, seen {seen_size}."
    if servo.encoder_increments is not None:
        return (
            f"{found} {where} encoder_increments: {servo.encoder_increments / seen_ratio:.4g} (is"
            f" {servo.encoder_increments:g}); see the encoder's data sheet. If it states"
            f" {servo.encoder_increments:g}, check the gear."
        )
    joint = robot.joints[robot.joint_names.index(motion.joint)]
    if not _is_near_one(abs(motion.command_ratio)):
        return (
            f"{found} The encoder resolution in the drive (608Fh) is {seen_ratio:.3g} times the"
            " true one: correct it with the manufacturer's tool."
        )
    return (
        f"{found} Change in the robot file: joints, {motion.joint}: gear_ratio:"
        f" {joint.gear_ratio / seen_ratio:.4g} (is {joint.gear_ratio:g}), or correct the encoder"
        " resolution in the drive (608Fh)."
    )


def parse_amount(text: str, motion: AxisMotion, tool_mm: float) -> float:
    """Return the displacement that a person stated, in the unit of the motion, without sign.

    Args:
        text: A number in the unit of the motion; or the displacement of the tool point, as "24mm".
        motion: Commanded motion, and the motion that the drive has measured.
        tool_mm: Displacement of the tool point by the commanded motion [mm].

    Raises:
        ConfigError: The text is not such a number, or not from 0 to less than 10000; or it is a
            displacement of the tool point, but the tool point is on the axis.
    """
    words = text.strip().lower().replace(",", ".")
    of_tool = words.endswith("mm") and motion.unit == "°"
    try:
        value = float(words.removesuffix("mm").removesuffix("°").removesuffix("deg").strip())
    except ValueError:
        raise ConfigError(
            f"{text!r}: give a number, such as 2, or the displacement of the tool point, such as"
            " 24mm",
            code="RID-AXIS-TEST-ANSWER",
        ) from None
    if not 0.0 <= value < 1e4:
        raise ConfigError(
            f"{text!r}: give a displacement without a sign, below 10000",
            code="RID-AXIS-TEST-ANSWER",
        )
    if not of_tool:
        return value
    if tool_mm <= 0.0:
        raise ConfigError(
            f"{text!r}: the tool point is on the axis of this joint and does not move: give"
            " degrees",
            code="RID-AXIS-TEST-ANSWER",
        )
    return value / tool_mm * abs(motion.commanded)
