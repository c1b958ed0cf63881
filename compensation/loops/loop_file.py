"""File of velocity loops, written by `rid-daq loop`: strict, self-contained JSON."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import Field

from compensation.loops.velocity_loop import EXTRAS, VelocityLoop
from config.errors import ConfigError
from config.formats.json_file import json_content, read_content
from config.formats.whole_file import write_whole
from config.model import ConfigModel
from config.quantities import NonNegative, Positive
from config.sealed_model import SealedModel

FORMAT: Final = "rid-daq velocity loops 3"
UNSOUND_LOOPS: Final = "RID-LOOP-UNSOUND"
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
    misfit: NonNegative


class LoopFile(SealedModel):
    """Velocity loops of a robot's drives, measured in one run.

    Attributes:
        cell: Name of the cell whose drives were measured; empty for an imported run.
    """

    format: Literal["rid-daq velocity loops 3"]
    robot: str
    cell: str
    run: str
    loops: tuple[LoopEntry, ...] = Field(min_length=1)
    sha256: str


def write_loops(
    path: Path, loops: Sequence[VelocityLoop], robot: str, run: str, cell: str = ""
) -> None:
    """Write loops to a file; the file is written completely or not at all.

    Args:
        robot, run, cell: Origin of the loops, as in `LoopFile`.

    Raises:
        RecordingError: The file cannot be written.
    """
    entries = [
        LoopEntry.from_attributes(loop, joint=loop.joint_name, fitted=loop.names) for loop in loops
    ]
    file = LoopFile(format=FORMAT, robot=robot, cell=cell, run=run, loops=tuple(entries), sha256="")
    write_whole(path, (file.with_digest().model_dump_json(indent=1) + "\n").encode())


def read_loops(path: Path) -> tuple[LoopFile, tuple[VelocityLoop, ...]]:
    """Return the content of a loop file and its loops.

    Raises:
        ConfigError: The file cannot be read, is not a loop file, contradicts itself or was edited.
    """
    return loops_content(read_content(path, LARGEST_FILE_BYTES), path)


def loops_content(data: bytes, path: Path) -> tuple[LoopFile, tuple[VelocityLoop, ...]]:
    """Parse the content of a loop file; errors are those of `read_loops`."""
    what = "a loop file of `rid-daq loop`"
    file = json_content(data, path, LoopFile, what)
    try:
        _refuse_contradictions(file)
        file.refuse_edited(UNSOUND_LOOPS, "restore the file, or run `rid-daq loop` again")
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}", code=error.refusal) from None
    loops = tuple(
        entry.to_dataclass(VelocityLoop, joint_name=entry.joint, names=entry.fitted, trials=())
        for entry in file.loops
    )
    return file, loops


def _refuse_contradictions(file: LoopFile) -> None:
    """Refuse two loops of one joint, unknown parameters, and covariances that do not fit them.

    Raises:
        ConfigError: The file contradicts itself; the text begins with the key.
    """
    joints = [entry.joint for entry in file.loops]
    for number, entry in enumerate(file.loops):
        place, k = f"loops.{number}", len(entry.fitted)
        if entry.joint in joints[:number]:
            raise ConfigError(
                f"{place}.joint: {entry.joint} has two loops; remove one, or run `rid-daq loop`"
                " again",
                code=UNSOUND_LOOPS,
            )
        unknown = set(entry.fitted) - {"gain", "integral_time_s", *EXTRAS}
        if unknown or len(set(entry.fitted)) < k:
            raise ConfigError(
                f"{place}.fitted: {', '.join(entry.fitted)} are not different parameters of a loop;"
                " run `rid-daq loop` again",
                code=UNSOUND_LOOPS,
            )
        if len(entry.covariance) != k or any(len(row) != k for row in entry.covariance):
            raise ConfigError(
                f"{place}.covariance: must have {k} rows of {k} values, one for each of `fitted`;"
                " run `rid-daq loop` again",
                code=UNSOUND_LOOPS,
            )
        if any(entry.covariance[i][i] < 0.0 for i in range(k)):
            raise ConfigError(
                f"{place}.covariance: has a negative variance; run `rid-daq loop` again",
                code=UNSOUND_LOOPS,
            )
