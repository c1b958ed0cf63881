"""`ImportMap`: description of another program's recording: columns, units and signs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import accumulate
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from config.errors import ConfigError
from config.formats.yaml_tree import parse_yaml
from config.load import read_named, validate
from config.model import ConfigModel
from config.plausible import Derived, PhysicalFile, Plausible
from config.robot.robot import MOST_JOINTS, Positive, RobotDescription


def _refuse_column_name(value: object) -> object:
    """Raise an error if a column is given by its name instead of its number.

    Raises:
        ValueError: The value is a name.
    """
    if isinstance(value, str):
        raise ValueError(
            f"columns are given by number, counted from 0: give the number of column {value!r}"
        )
    return value


Column = Annotated[int, BeforeValidator(_refuse_column_name), Field(ge=0, lt=10_000)]
Columns = Annotated[int, Field(ge=2, le=10_000)]

PositionUnit = Literal["rad", "deg", "rev", "m", "mm"]
VelocityUnit = Literal["rad/s", "deg/s", "rpm", "m/s", "mm/s"]

_LARGEST_OFFSET = {"rad": 15.0, "deg": 900.0, "rev": 2.5, "m": 50.0, "mm": 5e4}
_LARGEST_GEAR = 5e3


class TimeColumn(ConfigModel):
    """Column and unit of the time stamps. The steps may vary: the stamps are used as they are."""

    column: Column
    unit: Literal["s", "ms", "us"] = "s"


class FurtherFile(ConfigModel):
    """An additional file, read in the same way as the first one.

    Its columns continue the numbering of the previous file; the column of `time` is counted in the
    file itself. Without `time`, its stamps are in the same column as in the first file.
    """

    columns: Columns
    time: TimeColumn | None = None


class JointReading(ConfigModel):
    """Conversion of the numbers of one joint, in any kind of file.

    For values of the motor, `gear_ratio` converts to the link side: motor turns per joint turn,
    negative if motor and joint turn in opposite directions. The torque is a current times
    `torque_constant_nm_per_a`; without this key it is the current times the link-side constant in
    the robot file. With `gear_ratio`, the map's torque constant is that of the motor, too.
    `zero_offset` is the recorded position at position 0 of the robot file's joint, in the unit of
    the recorded position. `position_sign` and `torque_sign` are -1 if the value's direction is
    opposite to that of the robot file's joint; `position_sign` also applies to the velocity.
    """

    joint: str
    torque_constant_nm_per_a: Annotated[Positive, Plausible(1e-3, 5e3, "N m/A")] | None = None
    gear_ratio: Annotated[float, Plausible(0.05, 1e5, "")] | None = None
    zero_offset: float = 0.0
    position_sign: Literal[1, -1] = 1
    torque_sign: Literal[1, -1] = 1

    @model_validator(mode="after")
    def _check_gear_sign(self) -> JointReading:
        if self.gear_ratio == 0.0:
            raise ValueError("gear_ratio must not be 0")
        if self.gear_ratio is not None and self.gear_ratio < 0.0 and self.position_sign < 0:
            raise ValueError(
                "gear_ratio is negative and position_sign is -1: the signs cancel. Give one sign"
                " only"
            )
        return self


class JointStates(ConfigModel):
    """Description of a ROS 2 bag or MCAP file with `sensor_msgs/msg/JointState` messages.

    `effort` says if efforts are torques or motor currents. `topic` is needed if several topics have
    such messages. `names` (base to flange) is needed if the messages and the robot file use
    different joint names. `joints` lists joints with other settings than in the robot file: a sign,
    a zero position, a gear ratio, a torque constant.
    """

    effort: Literal["torque", "current"]
    topic: str | None = None
    names: tuple[str, ...] = ()
    joints: tuple[JointReading, ...] = ()

    @model_validator(mode="after")
    def _check_names(self) -> JointStates:
        for names in ([joint.joint for joint in self.joints], self.names):
            if len(set(names)) != len(names):
                raise ValueError("two joints have the same name")
        constants = [j.joint for j in self.joints if j.torque_constant_nm_per_a is not None]
        if constants and self.effort == "torque":
            raise ValueError(
                f"torque_constant_nm_per_a of {', '.join(constants)} applies to currents only:"
                " set effort: current, or remove it"
            )
        return self


class ImportUnits(ConfigModel):
    """Units of the columns; all values are converted to SI units during the import."""

    position: PositionUnit = "rad"
    velocity: VelocityUnit = "rad/s"
    current: Literal["A", "mA"] = "A"
    torque: Literal["Nm", "mNm", "N"] = "Nm"
    temperature: Literal["C", "K"] = "C"


class ImportJoint(JointReading):
    """Columns of one joint, counted from 0.

    The torque comes from a `torque` column or a `current` column. `velocity` is optional. It does
    not replace the derivative of the position: both are compared to detect a wrong column, unit or
    clock. `temperature` is that of the drive, for temperature-dependent friction: all joints have
    it, or none.
    """

    position: Column
    velocity: Column | None = None
    current: Column | None = None
    torque: Column | None = None
    temperature: Column | None = None

    @model_validator(mode="after")
    def _check_torque_columns(self) -> ImportJoint:
        if (self.current is None) == (self.torque is None):
            raise ValueError("give either a torque column or a current column, not both")
        if self.current is None and self.torque_constant_nm_per_a is not None:
            raise ValueError(
                "torque_constant_nm_per_a applies to a current column only: give a"
                " current column, or remove it"
            )
        return self


class DamageLimits(ConfigModel):
    """Limits beyond which a row counts as damaged; link side, SI units, for every joint.

    A step between neighbouring rows that exceeds `speed` is a jump, and also counts as damage,
    unless a long stretch of rows continues from there.
    """

    position: Annotated[Positive, Plausible(0.05, 150.0, "rad or m")] = 100.0
    speed: Annotated[Positive, Plausible(1e-2, 60.0, "rad/s or m/s")] = 20.0
    torque: Annotated[Positive, Plausible(0.1, 5e5, "N m or N")] = 1e5


class RowRange(ConfigModel):
    """Rows to use, counted from 1 as in an editor; `last` is included."""

    first: Annotated[int, Field(ge=1)] = 1
    last: Annotated[int, Field(ge=1)] | None = None

    @model_validator(mode="after")
    def _check_order(self) -> RowRange:
        if self.last is not None and self.last <= self.first:
            raise ValueError(f"last {self.last} must be greater than first {self.first}")
        return self


class ImportMap(PhysicalFile, Derived):
    """Layout of one kind of recording: `columns` for CSV files, `joint_states` for bags.

    `columns` is the number of columns of a sound row; a row with another number is damaged. The
    time is the column `time`, or the row's number divided by `rate_hz`. The `further_files` follow
    the first file on the command line, in this order; their columns continue its numbering, and
    their values are interpolated to its time stamps.

    `left_out_limit` is the share of rows that may be left out as damaged; beyond it the import is
    refused. `period_s` says that the used rows contain whole periods of this length, which are
    averaged; without it the recording is treated as not periodic and is smoothed.

    `side: motor` says that all columns are those of the motors: positions are divided, and torques
    multiplied, by the robot's gear ratios (or a joint's own `gear_ratio`). If the robot has a
    `coupling` C, these positions alpha become the joints' q = C alpha (5.18). With `side: link`,
    positions are those of the joints. In both cases torques are those of the actuators, seen from
    the link side.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][\w.-]{0,63}$")
    robot: str
    columns: Columns | None = None
    delimiter: Literal[",", ";", "tab", "space"] = ","
    decimal: Literal[".", ","] = "."
    header_rows: Annotated[int, Field(ge=0, le=1000)] = 0
    time: TimeColumn | None = None
    rate_hz: Annotated[Positive, Plausible(1.0, 1e5, "Hz")] | None = None
    further_files: tuple[FurtherFile, ...] = Field(default=(), max_length=3)
    joint_states: JointStates | None = None
    units: ImportUnits = ImportUnits()
    side: Literal["link", "motor"] = "link"
    joints: Annotated[tuple[ImportJoint, ...], Field(max_length=MOST_JOINTS)] = ()
    plausible: DamageLimits = DamageLimits()
    left_out_limit: Annotated[float, Field(ge=0.0, le=0.5)] = 0.02
    rows: RowRange = RowRange()
    period_s: Annotated[Positive, Plausible(0.05, 3600.0, "s")] | None = None

    @model_validator(mode="after")
    def _check_layout(self) -> ImportMap:
        if self.joint_states is not None:
            given = self.model_fields_set & {"columns", "time", "rate_hz", "joints"}
            given |= self.model_fields_set & {"further_files", "delimiter", "decimal"}
            if given:
                raise ValueError(
                    f"joint_states excludes {', '.join(sorted(given))}: the messages define these"
                )
            return self
        if self.columns is None or not self.joints:
            raise ValueError(
                "no layout: give columns and joints for a CSV file, or joint_states for a bag"
            )
        if (self.time is None) == (self.rate_hz is None):
            raise ValueError(
                "give either time (the column of time stamps) or rate_hz (rows per second)"
            )
        if self.rate_hz is not None and any(file.time for file in self.further_files):
            raise ValueError(
                "with rate_hz, rows are counted in every file: remove `time` of the further files"
            )
        if self.decimal == self.delimiter:
            raise ValueError(
                f"decimal and delimiter are both {self.decimal!r}: if numbers have a decimal"
                " comma, give another delimiter: ';', tab or space"
            )
        return self

    @model_validator(mode="after")
    def _check_columns(self) -> ImportMap:
        names = self.joint_names
        if len(set(names)) != len(names):
            raise ValueError("two joints have the same name")
        used: dict[int, str] = {}
        for role, column in (*self._time_columns(), *self._joint_columns()):
            if column >= self.first_columns[-1]:
                raise ValueError(
                    f"{role} is column {column}, but rows have columns 0 to"
                    f" {self.first_columns[-1] - 1}"
                )
            if column in used:
                raise ValueError(f"column {column} is both {used[column]} and {role}")
            used[column] = role
        without = [joint.joint for joint in self.joints if joint.temperature is None]
        if 0 < len(without) < len(self.joints):
            raise ValueError(
                f"{', '.join(without)} has no temperature column, but other joints have: give"
                " every joint one, or none"
            )
        return self

    def derived(self) -> dict[str, tuple[float, Plausible]]:
        """Return the zero offsets, in the unit and at the side of the positions."""
        states = self.joint_states
        prefix = "joints" if states is None else "joint_states.joints"
        joints: Sequence[JointReading] = self.joints if states is None else states.joints
        unit, motor = self.units.position, _LARGEST_GEAR if self.side == "motor" else 1.0
        return {
            f"{prefix}.{number}.zero_offset": (
                abs(joint.zero_offset),
                Plausible(0.0, _LARGEST_OFFSET[unit] * abs(joint.gear_ratio or motor), unit),
            )
            for number, joint in enumerate(joints)
        }

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joint names, base to flange; empty if `joint_states` takes them from the robot."""
        return tuple(joint.joint for joint in self.joints)

    @property
    def first_columns(self) -> tuple[int, ...]:
        """First column of each file, and the end of the last file's columns."""
        widths = (self.columns or 0, *(file.columns for file in self.further_files))
        return (0, *accumulate(widths))

    def time_column_of_file(self, number: int) -> TimeColumn | None:
        """Return the time column of file `number`, counted in that file; None with `rate_hz`."""
        return self.time if number == 0 else self.further_files[number - 1].time or self.time

    def _time_columns(self) -> Iterator[tuple[str, int]]:
        widths = (self.columns or 0, *(file.columns for file in self.further_files))
        for number, width in enumerate(widths):
            time = self.time_column_of_file(number)
            if time is not None:
                role = f"time of file {number + 1}" if number else "time"
                if time.column >= width:
                    raise ValueError(
                        f"{role} is column {time.column}, but rows of that file have columns 0 to"
                        f" {width - 1}"
                    )
                yield role, self.first_columns[number] + time.column

    def _joint_columns(self) -> Iterator[tuple[str, int]]:
        for joint in self.joints:
            for quantity in ("position", "velocity", "current", "torque", "temperature"):
                column: int | None = getattr(joint, quantity)
                if column is not None:
                    yield f"{quantity} of {joint.joint}", column


def load_import_map(reference: str) -> tuple[ImportMap, RobotDescription]:
    """Load an import map and the robot that it names.

    Args:
        reference: Name of a bundled map, or path of a map.

    Raises:
        ConfigError: A file is missing or invalid, or the joints do not match.
    """
    text, name, folder = read_named(reference, "maps", None)
    tree = parse_yaml(text, name)
    import_map = validate(tree, ImportMap)
    robot_text, robot_name, _ = read_named(import_map.robot, "robots", folder)
    robot = validate(parse_yaml(robot_text, robot_name), RobotDescription)
    states, named = import_map.joint_states, import_map.joint_names
    if states is not None:
        named = robot.joint_names
        if states.names and len(states.names) != len(named):
            raise ConfigError(
                f"{tree.where(('joint_states', 'names'))}: {len(states.names)} names, but robot"
                f" {robot.name} has {len(named)} joints: give one name per joint, base to flange",
                code="RID-IMPORT-JOINTS",
            )
        for number, joint in enumerate(states.joints):
            if joint.joint not in named:
                where = tree.where(("joint_states", "joints", number, "joint"))
                raise ConfigError(
                    f"{where}: robot {robot.name} has no joint {joint.joint!r}; it has"
                    f" {', '.join(named)}",
                    code="RID-IMPORT-JOINTS",
                )
    if named != robot.joint_names:
        raise ConfigError(
            f"{tree.where(('joints',))}: joints are {', '.join(named)}, but robot {robot.name}"
            f" has {', '.join(robot.joint_names)}: use the same names, base to flange",
            code="RID-IMPORT-JOINTS",
        )
    return import_map, robot
