"""Joint positions over time, in the motion file or in a CSV file next to it."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field, ValidationError, model_validator
from scipy.interpolate import make_interp_spline

from acquisition.motion.kinds.motion import LONGEST_MOTION_S, Motion, refuse_longer
from acquisition.motion.samples import JointTrajectory, MotionSamples, with_rests
from config.arrays import FloatArray
from config.errors import ConfigError, LimitError
from config.formats.bounded_file import read_file
from config.formats.number import parse_number
from config.load import to_yaml
from config.plausible import Derived, Plausible, implausible, key_name
from config.robot.robot import RobotDescription

AT_REST: Final = 0.02
FEWEST_ROWS: Final = 6
TIME: Final = "time_s"
MOST_BYTES: Final = 200_000_000
POSITIONS: Final = Plausible(0.0, 50.0, "rad or m")
TIMES: Final = Plausible(0.01, LONGEST_MOTION_S, "s")


class JointTableMotion(Motion, Derived):
    """Joint positions over time, from a CSV file, or in the motion file itself.

    A smooth curve (of class C4) passes through the rows. It must begin and end at rest.

    Attributes:
        file: CSV file next to the motion file. It has a column `time_s` and one column per joint,
            with the joint's name [rad or m].
        joints: Without `file`: names of the joints, in the order of the columns of `position`.
        time_s: Without `file`: time of each row [s].
        position: Without `file`: rows of joint positions [rad or m].
        dwell_s: Rest before and after the motion [s].
    """

    kind: Literal["joint_table"]
    file: str | None = None
    joints: tuple[str, ...] = ()
    time_s: tuple[float, ...] = Field(default=(), max_length=1_000_000)
    position: tuple[tuple[float, ...], ...] = Field(default=(), max_length=1_000_000)
    dwell_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.2

    @model_validator(mode="after")
    def _check_source(self) -> JointTableMotion:
        if (self.file is None) == (not self.time_s):
            raise ValueError("give either file, or joints, time_s and position")
        if len(self.time_s) != len(self.position):
            raise ValueError(
                f"time_s has {len(self.time_s)} rows, position {len(self.position)}: give the"
                " same number"
            )
        for number, row in enumerate(self.position, start=1):
            if len(row) != len(self.joints):
                raise ValueError(
                    f"row {number} of position has {len(row)} values for {len(self.joints)} joints"
                )
        return self

    def derived(self) -> dict[str, tuple[float, Plausible]]:
        """Return the largest position and the duration of the table, once it is read."""
        furthest = max((abs(value) for row in self.position for value in row), default=0.0)
        lasts_s = max(self.time_s) - min(self.time_s) if self.time_s else 0.0
        return {"position": (furthest, POSITIONS), "time_s": (lasts_s, TIMES)}

    @property
    def read_later(self) -> frozenset[str]:
        """Keys whose values are in the CSV file."""
        return frozenset({"position", "time_s"}) if self.file is not None else frozenset()

    def describe(self) -> str:
        """Return a description of the motion in one sentence."""
        return f"A table of {len(self.time_s)} rows of joint positions."

    def next_command(self, run: Path) -> tuple[object, ...]:
        """Return the command that shows the path error."""
        return "tracking", run

    def to_keep(self, written: bytes) -> bytes:
        """Return the motion file with the rows of the CSV file in it."""
        return to_yaml(self).encode()

    def completed(self, folder: Path) -> JointTableMotion:
        """Return the motion with the rows of its CSV file.

        Args:
            folder: Folder of the motion file, in which the CSV file is searched.

        Raises:
            ConfigError: The file cannot be read, or one of its rows is invalid; the text names it.
        """
        if self.file is None:
            return self
        path = folder / Path(self.file).expanduser()
        joints, time_s, position = _read_table(path)
        try:
            whole = JointTableMotion.from_attributes(
                self, file=None, joints=joints, time_s=time_s, position=position
            )
        except ValidationError as error:
            raise ConfigError(
                f"{path}: {error.errors()[0]['msg']}", code="RID-FILE-VALUE"
            ) from None
        found = [f"{path}: {key_name(key)}: {words}" for key, words in implausible(whole)]
        if found:
            raise ConfigError("\n".join(found), code="RID-TABLE-INVALID")
        return whole

    def _samples(self, robot: RobotDescription, sample_period_s: float) -> MotionSamples:
        refuse_longer(max(self.time_s) - min(self.time_s), "the times of its table")
        if sorted(self.joints) != sorted(robot.joint_names):
            raise ConfigError(
                f"the table has columns for {', '.join(self.joints) or 'no joint'}, but robot"
                f" {robot.name!r} needs each of {', '.join(robot.joint_names)} once",
                code="RID-MOTION-JOINTS",
            )
        order = [self.joints.index(name) for name in robot.joint_names]
        time_s, position = np.array(self.time_s), np.array(self.position)[:, order]
        _check_rows(time_s, position, robot)
        rest = [(1, np.zeros(len(robot.joints))), (2, np.zeros(len(robot.joints)))]
        curve = make_interp_spline(time_s, position, k=5, bc_type=(rest, rest))  # type: ignore[arg-type]
        rows = math.ceil((time_s[-1] - time_s[0]) / sample_period_s - 1e-9)
        at_s = np.minimum(time_s[0] + np.arange(rows + 1) * sample_period_s, time_s[-1])
        path = JointTrajectory(*(np.asarray(curve(at_s, order)) for order in range(3)))
        return with_rests(path, self.dwell_s, robot.joint_names, sample_period_s)


def _check_rows(time_s: FloatArray, position: FloatArray, robot: RobotDescription) -> None:
    """Check that times increase, positions are within the limits, and both ends are at rest."""
    if len(time_s) < FEWEST_ROWS:
        raise ConfigError(
            f"the table has {len(time_s)} rows, but at least {FEWEST_ROWS} are needed",
            code="RID-TABLE-INVALID",
        )
    steps = np.diff(time_s)
    if (steps <= 0.0).any():
        row = int(np.argmax(steps <= 0.0)) + 2
        raise ConfigError(
            f"row {row} of the table is at {time_s[row - 1]:g} s, not later than the previous"
            " row: time_s must increase",
            code="RID-TABLE-INVALID",
        )
    for j, joint in enumerate(robot.joints):
        low, high = joint.limits.position_min, joint.limits.position_max
        off = (position[:, j] < low) | (position[:, j] > high)
        if off.any():
            row = int(np.argmax(off))
            at, unit = float(position[row, j]), "rad" if joint.type == "revolute" else "m"
            likely = Plausible(0.0, max(abs(low), abs(high)), unit).likely_unit(abs(at))
            raise LimitError(
                f"row {row + 1} of the table has joint {joint.name!r} at {at:.4g} {unit},"
                f" outside its limits {low:g} to {high:g} {unit}{likely}",
                code="RID-MOTION-LIMIT",
            )
        for row, speed in (
            (1, abs(position[1, j] - position[0, j]) / steps[0]),
            (len(time_s), abs(position[-1, j] - position[-2, j]) / steps[-1]),
        ):
            if speed > AT_REST * joint.limits.velocity:
                raise ConfigError(
                    f"in row {row} of the table joint {joint.name!r} moves at {speed:.3g} per"
                    " second, but the table must begin and end at rest: add rows that accelerate"
                    " from rest and brake to rest",
                    code="RID-TABLE-INVALID",
                )


def _read_table(
    path: Path,
) -> tuple[tuple[str, ...], tuple[float, ...], tuple[tuple[float, ...], ...]]:
    """Return the joints, times and positions of a CSV file."""
    try:
        text = read_file(path, MOST_BYTES).decode("utf-8-sig")
        lines = list(csv.reader(io.StringIO(text, newline="")))
    except OSError as error:
        raise ConfigError(f"{path}: cannot read: {error.strerror}", code="RID-FILE-READ") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"{path}: is not a CSV file: {error}", code="RID-FILE-TYPE") from None
    header = [name.strip() for name in lines[0]] if lines else []
    if header.count(TIME) != 1:
        raise ConfigError(
            f"{path}:1: the first line must contain the column names: {TIME} and the joints",
            code="RID-TABLE-INVALID",
        )
    column = header.index(TIME)
    time_s, position = [], []
    for number, line in enumerate(lines[1:], start=2):
        if not any(cell.strip() for cell in line):
            continue
        values = _parse_row(path, number, line, len(header))
        time_s.append(values.pop(column))
        position.append(tuple(values))
    del header[column]
    if not header or not time_s:
        missing = "no joint column" if not header else "no row below the column names"
        raise ConfigError(f"{path}: has {missing}: it contains no motion", code="RID-TABLE-INVALID")
    return tuple(header), tuple(time_s), tuple(position)


def _parse_row(path: Path, number: int, line: list[str], columns: int) -> list[float]:
    if len(line) != columns:
        raise ConfigError(
            f"{path}:{number}: has {len(line)} columns, but the first line has {columns}",
            code="RID-TABLE-INVALID",
        )
    values = []
    for cell in line:
        try:
            values.append(parse_number(cell))
        except ConfigError as error:
            raise ConfigError(f"{path}:{number}: {error}", code=error.refusal) from None
    return values
