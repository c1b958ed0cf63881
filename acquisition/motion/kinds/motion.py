"""`Motion`: base class of all kinds of motion."""

from __future__ import annotations

from abc import abstractmethod
from pathlib import Path
from typing import Annotated, Final, Self, final

from acquisition.motion.limits import verify_limits
from acquisition.motion.samples import MotionSamples
from config.errors import ConfigError
from config.plausible import PhysicalFile, Plausible
from config.quantities import Positive
from config.robot.robot import RobotDescription

LONGEST_MOTION_S: Final = 4 * 3600.0

Position = Annotated[float, Plausible(0.0, 50.0, "rad or m")]
Speed = Annotated[Positive, Plausible(1e-6, 60.0, "rad/s or m/s")]
ToolSpeed = Annotated[Positive, Plausible(1e-5, 20.0, "m/s")]
Seconds = Annotated[Positive, Plausible(1e-3, LONGEST_MOTION_S, "s")]
Poses = tuple[tuple[float, ...], ...]
"""Poses, each with one position per joint, base to flange [rad or m]."""


class Motion(PhysicalFile):
    """Description of a motion, before its samples are computed.

    Attributes:
        kind: Kind of motion; it decides which other keys there are.
        robot: Name of the robot for which the motion was made; a cell with another robot refuses
            it.
    """

    kind: str
    robot: str

    @final
    def plan(self, robot: RobotDescription, sample_period_s: float) -> MotionSamples:
        """Return the checked samples of the motion; they start and end at rest.

        Args:
            robot: Joints and limits.
            sample_period_s: Cycle time of the cell [s].

        Returns:
            One row per cycle.

        Raises:
            ConfigError: The motion does not match the robot or the cycle time, or exceeds a limit;
                the text names the joint, the value and the limit.
        """
        samples = self._samples(robot, sample_period_s)
        verify_limits(samples, robot)
        return samples

    @abstractmethod
    def _samples(self, robot: RobotDescription, sample_period_s: float) -> MotionSamples:
        """Return the samples; refuse motions that are too long before computing them."""

    @abstractmethod
    def describe(self) -> str:
        """Return a description of the motion in one sentence."""

    @abstractmethod
    def next_command(self, run: Path) -> tuple[object, ...]:
        """Return the command that uses a recording of this motion in the folder `run`."""

    def joint_table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]] | None:
        """Return headings and one row per joint; None if `describe` names everything."""
        return None

    def chosen_poses(self, robot: RobotDescription, most: int) -> Poses | None:
        """Return the poses of a motion that consists of at most `most` poses; otherwise None."""
        return None

    def where(self, robot: RobotDescription, sample_period_s: float, row: int) -> str:
        """Return a description of a row's place on the path; empty for kinds without a path."""
        return ""

    def with_file_data(self, folder: Path) -> Self:
        """Return the motion with the data of the files that it names, relative to `folder`."""
        return self

    def to_keep(self, written: bytes) -> bytes:
        """Return a motion file that contains all data: by default, the file as it was written."""
        return written

    @classmethod
    def of(cls, motion: Motion) -> Self | None:
        """Return the motion if it is of this kind, else None."""
        return motion if isinstance(motion, cls) else None

    @classmethod
    def require(cls, motion: Motion, refusal: str) -> Self:
        """Return the motion, which must be of this kind.

        Args:
            motion: A motion of any kind.
            refusal: Text of the error.

        Raises:
            ConfigError: The motion is of another kind.
        """
        found = cls.of(motion)
        if found is None:
            raise ConfigError(refusal, code="RID-MOTION-KIND")
        return found


def refuse_longer(seconds: float, what: str) -> None:
    """Raise an error if a motion is too long; called before its samples are computed.

    Args:
        seconds: Duration of the motion [s].
        what: Part of the motion that takes this time, for the message.

    Raises:
        ConfigError: The duration exceeds `LONGEST_MOTION_S`.
    """
    if seconds > LONGEST_MOTION_S:
        raise ConfigError(
            f"the motion takes {seconds:.6g} s ({what}), but at most {LONGEST_MOTION_S:g} s are"
            " permitted. Shorten the motion",
            code="RID-MOTION-LONG",
        )
