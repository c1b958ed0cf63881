"""File of velocity loops, written by `rid-daq loop`: strict, self-contained JSON."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import Field

from compensation.loops.velocity_loop import VelocityLoop
from config.formats.json_file import json_content, read_content
from config.formats.whole_file import write_whole
from config.model import ConfigModel
from config.quantities import NonNegative, Positive

FORMAT: Final = "rid-daq velocity loops 1"
LARGEST_FILE_BYTES: Final = 1_000_000


class LoopEntry(ConfigModel):
    """One velocity loop; times in seconds, gain in N m s/rad or N s/m."""

    joint: str
    gain: Positive
    integral_time_s: Positive
    delay_s: NonNegative
    lag_s: NonNegative
    fitted: tuple[str, ...]
    covariance: tuple[tuple[float, ...], ...]
    p_value: Annotated[float, Field(ge=0.0, le=1.0)]
    whiteness: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0


class LoopFile(ConfigModel):
    """Velocity loops of a robot's drives, measured in one run."""

    format: Literal["rid-daq velocity loops 1"]
    robot: str
    run: str
    loops: tuple[LoopEntry, ...] = Field(min_length=1)


def write_loops(path: Path, loops: Sequence[VelocityLoop], robot: str, run: str) -> None:
    """Write loops to a file; the file is written completely or not at all."""
    entries = [
        LoopEntry.from_attributes(loop, joint=loop.joint_name, fitted=loop.names) for loop in loops
    ]
    file = LoopFile(format=FORMAT, robot=robot, run=run, loops=tuple(entries))
    write_whole(path, (file.model_dump_json(indent=1) + "\n").encode())


def read_loops(path: Path) -> tuple[str, tuple[VelocityLoop, ...]]:
    """Return the robot's name and its loops.

    Raises:
        ConfigError: The file cannot be read or is not a loop file.
    """
    return loops_content(read_content(path, LARGEST_FILE_BYTES), path)


def loops_content(data: bytes, path: Path) -> tuple[str, tuple[VelocityLoop, ...]]:
    """Parse the content of a loop file; see `read_loops`."""
    what = "a loop file of `rid-daq loop`"
    file = json_content(data, path, LoopFile, what)
    loops = tuple(
        entry.to_dataclass(VelocityLoop, joint_name=entry.joint, names=entry.fitted, trials=())
        for entry in file.loops
    )
    return file.robot, loops
