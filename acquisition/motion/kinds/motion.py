"""`Motion`: what every kind of motion knows of itself."""

from __future__ import annotations

from abc import abstractmethod
from pathlib import Path
from typing import Annotated, Final, Self, final

from acquisition.motion.limits import verify_limits
from acquisition.motion.samples import MotionSamples
from config.errors import ConfigError
from config.plausible import PhysicalFile, Plausible
from config.robot.robot import Positive, RobotDescription

LONGEST_MOTION_S: Final = 4 * 3600.0

Position = Annotated[float, Plausible(0.0, 50.0, "rad or m")]
Speed = Annotated[Positive, Plausible(1e-6, 60.0, "rad/s or m/s")]
ToolSpeed = Annotated[Positive, Plausible(1e-5, 20.0, "m/s")]
Seconds = Annotated[Positive, Plausible(1e-3, LONGEST_MOTION_S, "s")]


class Motion(PhysicalFile):
    """What a robot is to do, before a single sample of it is computed."""

    kind: str
    robot: str

    @final
    def plan(self, robot: RobotDescription, sample_period_s: float) -> MotionSamples:
        """Return the motion's verified samples; they start and end at rest.

        Args:
            robot: Joints and limits.
            sample_period_s: The cell's cycle time [s].

        Returns:
            One row a cycle.

        Raises:
            ConfigError: The motion does not fit the robot, the cycle time or a limit; the text
                names the joint, the value and the limit.
        """
        samples = self._samples(robot, sample_period_s)
        verify_limits(samples, robot)
        return samples

    @abstractmethod
    def _samples(self, robot: RobotDescription, sample_period_s: float) -> MotionSamples:
        """Return the samples, or refuse what takes too long before computing them."""

    @abstractmethod
    def describe(self) -> str:
        """Return in a sentence what the motion file asks for."""

    @abstractmethod
    def next_command(self, run: Path) -> tuple[object, ...]:
        """Return the words of the command that makes use of a recording in the folder `run`."""

    def joint_table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]] | None:
        """Return headings and a row a joint, where joints do what the sentence does not tell."""
        return None

    def where(self, robot: RobotDescription, sample_period_s: float, row: int) -> str:
        """Return where on its path a row lies; empty where its time says it all."""
        return ""

    def completed(self, folder: Path) -> Self:
        """Return the motion with what its file, in `folder`, leaves to other files."""
        return self

    def to_keep(self, written: bytes) -> bytes:
        """Return the text that says the whole motion: as its file was written, where that does."""
        return written

    @classmethod
    def of(cls, motion: Motion) -> Self | None:
        """Return a motion as one of this kind, None where it is of another one."""
        return motion if isinstance(motion, cls) else None

    @classmethod
    def require(cls, motion: Motion, refusal: str) -> Self:
        """Return a motion as one of this kind.

        Args:
            motion: Of any kind.
            refusal: What to say where it is of another one.

        Raises:
            ConfigError: It is of another kind.
        """
        found = cls.of(motion)
        if found is None:
            raise ConfigError(refusal, code="RID-MOTION-KIND")
        return found


def refuse_longer(seconds: float, what: str) -> None:
    """Refuse a motion that takes longer than can be run.

    Args:
        seconds: How long it takes, before any sample of it is computed [s].
        what: What takes so long.

    Raises:
        ConfigError: It takes longer than `LONGEST_MOTION_S`.
    """
    if seconds > LONGEST_MOTION_S:
        raise ConfigError(
            f"the motion takes {seconds:.6g} s: {what}; at most {LONGEST_MOTION_S:g} s can be run."
            " Give fewer or shorter ones",
            code="RID-MOTION-LONG",
        )
