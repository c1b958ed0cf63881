"""`TrajectoryRows`: joint positions over time from a planner's CSV, JSON or YAML file."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import AliasChoices, BaseModel, ConfigDict, Field, ValidationError

from config.errors import ConfigError
from config.formats.bounded_file import decode_text, read_file
from config.formats.json_file import parse_json
from config.formats.number import DECIMAL_COMMA, parse_number
from config.formats.yaml_tree import parse_yaml
from config.wrong_value import explain_error

MOST_BYTES: Final = 200_000_000
TIMES: Final = ("time_s", "time_from_start")
VELOCITIES: Final = ("{}_velocity", "velocity_{}", "{}_vel", "vel_{}")
ACCELERATIONS: Final = ("{}_acceleration", "acceleration_{}", "{}_acc", "acc_{}")
SEPARATORS: Final = (",", ";", "\t", " ")
ENVELOPES: Final = (
    "goal",
    "motion_plan_response",
    "trajectory",
    "planned_trajectory",
    "joint_trajectory",
)
"""Keys of other messages of ROS and MoveIt that contain a `trajectory_msgs/JointTrajectory`."""
Rows = tuple[tuple[float, ...], ...]
Finite = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Nanoseconds = Annotated[Finite, Field(ge=0.0, lt=1e9)]


@dataclass(frozen=True)
class TrajectoryRows:
    """Rows of a trajectory file.

    Attributes:
        joints: Names of the joints, in the order of the columns.
        time_s: Time of each row [s].
        position: Rows of joint positions [rad or m].
        velocity: Rows of joint velocities [rad/s or m/s]; empty if the file has none.
    """

    joints: tuple[str, ...]
    time_s: tuple[float, ...]
    position: Rows
    velocity: Rows


def read_trajectory(path: Path) -> TrajectoryRows:
    """Return the rows of a trajectory file.

    A CSV file has a column `time_s` or `time_from_start` and one column per joint. `VELOCITIES` has
    the forms of the names of velocity columns, and `ACCELERATIONS` those of acceleration columns,
    which are not used. `SEPARATORS` has the permitted separators; numbers may have decimal commas.
    A JSON or YAML file contains a `trajectory_msgs/JointTrajectory`, by itself or in a message of
    MoveIt; its accelerations and efforts are not used.

    Raises:
        ConfigError: The file cannot be read, or one of its rows is invalid; the text names it.
    """
    try:
        text = decode_text(read_file(path, MOST_BYTES))
    except OSError as error:
        raise ConfigError(f"{path}: cannot read: {error.strerror}", code="RID-FILE-READ") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not a text file: {error}", code="RID-FILE-TYPE") from None
    if path.suffix.lower() == ".json":
        try:
            tree = parse_json(text.encode())
        except ConfigError as error:
            raise ConfigError(f"{path}: {error}", code=error.refusal) from None
        return _rows_of_message(path, tree)
    if path.suffix.lower() in (".yaml", ".yml"):
        message = text.rstrip().removesuffix("---")  # `ros2 topic echo` appends this line
        return _rows_of_message(path, parse_yaml(message.encode(), str(path)).data)
    return _rows_of_csv(path, text)


class _Message(BaseModel):
    """A part of a message; an unknown key is an error, because it can be a typing error."""

    model_config = ConfigDict(extra="forbid")


class _Duration(_Message):
    seconds: Finite = Field(validation_alias=AliasChoices("sec", "secs"))
    nanoseconds: Nanoseconds = Field(default=0.0, validation_alias=AliasChoices("nanosec", "nsecs"))


class _Point(_Message):
    positions: tuple[Finite, ...]
    velocities: tuple[Finite, ...] = ()
    accelerations: Any = None
    effort: Any = None
    time_from_start: _Duration | Finite

    @property
    def time_s(self) -> float:
        at = self.time_from_start
        return at.seconds + 1e-9 * at.nanoseconds if isinstance(at, _Duration) else at


class _JointTrajectory(_Message):
    header: Any = None
    joint_names: tuple[str, ...] = Field(min_length=1)
    points: tuple[_Point, ...] = Field(min_length=1, max_length=1_000_000)


def _rows_of_message(path: Path, tree: Any) -> TrajectoryRows:
    for key in ENVELOPES:
        if isinstance(tree, dict) and key in tree:
            tree = tree[key]
        if isinstance(tree, list) and len(tree) > 1:
            raise ConfigError(
                f"{path}: contains {len(tree)} trajectories: give each in a file of its own",
                code="RID-TABLE-INVALID",
            )
        if isinstance(tree, list) and tree:
            tree = tree[0]
    if not isinstance(tree, dict) or "points" not in tree:
        raise ConfigError(
            f"{path}: has no joint trajectory: give one trajectory_msgs/JointTrajectory, with"
            " `joint_names` and `points`",
            code="RID-TABLE-INVALID",
        )
    try:
        message = _JointTrajectory.model_validate(tree)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise ConfigError(
            f"{path}: {place}: {explain_error(first)}", code="RID-TABLE-INVALID"
        ) from None
    with_velocity = sum(bool(point.velocities) for point in message.points)
    if with_velocity not in (0, len(message.points)):
        raise ConfigError(
            f"{path}: {with_velocity} of {len(message.points)} points have velocities: give them"
            " in each point, or in none",
            code="RID-TABLE-INVALID",
        )
    return TrajectoryRows(
        message.joint_names,
        tuple(point.time_s for point in message.points),
        tuple(point.positions for point in message.points),
        tuple(point.velocities for point in message.points) if with_velocity else (),
    )


def _rows_of_csv(path: Path, text: str) -> TrajectoryRows:
    text = text.removeprefix("#").lstrip(" ")
    lines: list[list[str]] = []
    times: list[int] = []
    for separator in SEPARATORS:
        lines = _split_lines(path, text, separator)
        header = lines[0] if lines else []
        times = [column for column, name in enumerate(header) if name in TIMES]
        if len(times) == 1 and len(header) > 1:
            break
    else:
        raise ConfigError(
            f"{path}:1: the first line must contain the column names: {' or '.join(TIMES)} once,"
            " and the joints",
            code="RID-TABLE-INVALID",
        )
    joints, velocities = _joint_columns(path, header, times[0])
    rows = [
        _parse_row(path, number, line, len(header))
        for number, line in enumerate(lines[1:], start=2)
        if any(line)
    ]
    if not joints or not rows:
        missing = "no joint column" if not joints else "no row below the column names"
        raise ConfigError(
            f"{path}: has {missing}, so it contains no motion: add a column per joint, and rows",
            code="RID-TABLE-INVALID",
        )
    return TrajectoryRows(
        tuple(header[column] for column in joints),
        tuple(row[times[0]] for row in rows),
        _columns(rows, joints),
        _columns(rows, velocities) if velocities else (),
    )


def _split_lines(path: Path, text: str, separator: str) -> list[list[str]]:
    """Return the cells of each line, with points instead of decimal commas.

    A comma is a decimal comma only if no number of the file contains a point.
    """
    file = io.StringIO("\n".join(line.rstrip(" ") for line in text.splitlines()), newline="")
    reader = csv.reader(file, delimiter=separator, skipinitialspace=True)
    try:
        lines = [[cell.strip() for cell in line] for line in reader]
    except csv.Error as error:
        raise ConfigError(f"{path}: is not a CSV file: {error}", code="RID-FILE-TYPE") from None
    while lines and lines[0][-1:] == [""] and all(line[-1:] in ([], [""]) for line in lines):
        lines = [line[:-1] for line in lines]  # a separator at the end of each row
    cells = [cell for line in lines[1:] for cell in line if "," in cell or "." in cell]
    if all(DECIMAL_COMMA.fullmatch(cell) for cell in cells):
        lines[1:] = [[cell.replace(",", ".") for cell in line] for line in lines[1:]]
    return lines


def _joint_columns(path: Path, header: list[str], time: int) -> tuple[list[int], list[int]]:
    """Return the columns of the positions, and those of the velocities in the same order."""
    forms = {form.format(name): name for name in header for form in VELOCITIES}
    speeds = {name: forms[name] for name in header if name in forms}
    velocity = {speeds[name]: column for column, name in enumerate(header) if name in speeds}
    unused = {form.format(name) for name in header for form in ACCELERATIONS}
    joints = [
        column
        for column, name in enumerate(header)
        if column != time and name not in speeds and name not in unused
    ]
    moving = [speeds[name] for name in header if name in speeds]
    if len(velocity) < len(moving):
        joint = next(each for each in moving if moving.count(each) > 1)
        raise ConfigError(
            f"{path}:1: has two columns of velocities of {joint}: remove one of these columns",
            code="RID-TABLE-INVALID",
        )
    without = [header[column] for column in joints if header[column] not in velocity]
    if velocity and without:
        raise ConfigError(
            f"{path}:1: has no velocity of {', '.join(without)}: give a column of velocities for"
            f" each joint ({without[0]}_velocity), or for none",
            code="RID-TABLE-INVALID",
        )
    return joints, [velocity[header[column]] for column in joints] if velocity else []


def _columns(rows: Sequence[Sequence[float]], columns: Sequence[int]) -> Rows:
    return tuple(tuple(row[column] for column in columns) for row in rows)


def _parse_row(path: Path, number: int, line: list[str], columns: int) -> list[float]:
    if len(line) != columns:
        decimal_commas = (
            "; quote numbers with decimal commas, or separate the columns by semicolons"
        )
        raise ConfigError(
            f"{path}:{number}: has {len(line)} columns, but the first line has {columns}: correct"
            f" the line{decimal_commas if len(line) == 2 * columns else ''}",
            code="RID-TABLE-INVALID",
        )
    values = []
    for cell in line:
        try:
            values.append(parse_number(cell))
        except ConfigError as error:
            raise ConfigError(f"{path}:{number}: {error}", code=error.refusal) from None
    return values
