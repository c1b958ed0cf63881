"""Joint positions over time, out of a CSV file that a motion file names."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from config.errors import ConfigError
from config.formats.bounded_file import read_file
from config.motion.path_motion import JointTableMotion

TIME: Final = "time_s"
MOST_BYTES: Final = 200_000_000


def with_table(motion: JointTableMotion, folder: Path | None) -> JointTableMotion:
    """Return the motion with the rows of its file in it, so that it is complete by itself.

    Parameters
    ----------
    motion
        As its motion file says it.
    folder
        Where that file lies; a relative name is looked for there.

    Raises
    ------
    ConfigError
        The file cannot be read, or a row of it is none; the text says which.
    """
    if motion.file is None:
        return motion
    path = Path(motion.file).expanduser()
    if folder is not None and not path.is_absolute():
        path = folder / path
    try:
        text = read_file(path, MOST_BYTES).decode("utf-8-sig")
        lines = list(csv.reader(io.StringIO(text, newline="")))
    except OSError as error:
        raise ConfigError(f"{path}: cannot read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"{path}: is no CSV file: {error}") from None
    header = [name.strip() for name in lines[0]] if lines else []
    if header.count(TIME) != 1:
        raise ConfigError(f"{path}:1: the first line must name the columns: {TIME}, and the joints")
    column = header.index(TIME)
    time_s, position = [], []
    for number, line in enumerate(lines[1:], start=2):
        if not any(cell.strip() for cell in line):
            continue
        values = _numbers(path, number, line, len(header))
        time_s.append(values.pop(column))
        position.append(tuple(values))
    del header[column]
    if not header or not time_s:
        missing = "no column of a joint" if not header else "no row below its first line"
        raise ConfigError(f"{path}: has {missing}: there is no motion in it")
    try:
        return JointTableMotion(
            kind="joint_table",
            robot=motion.robot,
            joints=tuple(header),
            time_s=tuple(time_s),
            position=tuple(position),
            dwell_s=motion.dwell_s,
        )
    except ValidationError as error:
        raise ConfigError(f"{path}: {error.errors()[0]['msg']}") from None


def _numbers(path: Path, number: int, line: list[str], columns: int) -> list[float]:
    if len(line) != columns:
        raise ConfigError(f"{path}:{number}: has {len(line)} columns, the first line {columns}")
    values = []
    for cell in line:
        try:
            values.append(float(cell))
        except ValueError:
            raise ConfigError(f"{path}:{number}: {cell!r} is not a number") from None
        if not math.isfinite(values[-1]):
            raise ConfigError(f"{path}:{number}: {cell!r} is not a finite number")
    return values
