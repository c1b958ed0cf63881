"""The motion that measures friction alone, verified and written."""

from __future__ import annotations

from pathlib import Path

from acquisition.motion.kinds.constant_velocity import ConstantVelocityMotion
from acquisition.motion.kinds.reversed import ReversedMotion
from config.formats.whole_file import write_whole
from config.load import LoadedCell, to_yaml
from rid_daq.terminal.console import Console


def write_friction_motion(
    console: Console,
    loaded: LoadedCell,
    motion: ConstantVelocityMotion | ReversedMotion,
    output: Path,
) -> None:
    """Verify a motion that measures friction, write it, and say what it does."""
    samples = motion.plan(loaded.robot, loaded.config.cycle_time_s)
    comment = (
        f"For robot {loaded.robot.name}, verified within its limits at"
        f" {loaded.config.cycle_time_ms} ms. {motion.describe()}"
    )
    write_whole(output, to_yaml(motion, comment).encode())
    console.document({"motion": str(output), "kind": motion.kind, "duration_s": samples.duration_s})
    console.say(f"{output}: {motion.describe()} {samples.duration_s:.0f} s in all.")


def say_speeds(console: Console, motion: ConstantVelocityMotion) -> None:
    """Say at which speeds, and where, each joint is run."""
    console.table(
        ("axis", "from", "to", "speeds"),
        [
            (
                spec.joint,
                f"{spec.low:.3f}",
                f"{spec.high:.3f}",
                ", ".join(f"{speed:g}" for speed in spec.speeds),
            )
            for spec in motion.joints
        ],
    )
