"""`ImportMap`: how to read someone else's recording - which column is what, in which unit."""

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


def _no_name(value: object) -> object:
    """Refuse a column's name, which a newcomer gives, with what is wanted.

    Raises:
        ValueError: It is a name.
    """
    if isinstance(value, str):
        raise ValueError(f"columns are counted from 0: give the number of {value!r}")
    return value


Column = Annotated[int, BeforeValidator(_no_name), Field(ge=0, lt=10_000)]
Columns = Annotated[int, Field(ge=2, le=10_000)]

PositionUnit = Literal["rad", "deg", "rev", "m", "mm"]
VelocityUnit = Literal["rad/s", "deg/s", "rpm", "m/s", "mm/s"]

_LARGEST_OFFSET = {"rad": 15.0, "deg": 900.0, "rev": 2.5, "m": 50.0, "mm": 5e4}
_LARGEST_GEAR = 5e3


class TimeColumn(ConfigModel):
    """The column of time stamps, and its unit. Steps may vary: the stamps are the truth."""

    column: Column
    unit: Literal["s", "ms", "us"] = "s"


class FurtherFile(ConfigModel):
    """A file beside the first one, read in the same way.

    Its columns are counted on from the last one of the file before; those of `time` are its own.
    Without `time` its stamps are where the first file has them.
    """

    columns: Columns
    time: TimeColumn | None = None


class JointReading(ConfigModel):
    """How one joint's numbers are read, whatever they stand in.

    Where they are its motor's, `gear_ratio` (motor turns per joint turn, negative where the motor
    turns against the joint) brings them to the link side. A current times
    `torque_constant_nm_per_a` is its torque; without that, times the link-side constant that the
    robot file states. With `gear_ratio` the map's torque constant is the motor's too.
    `zero_offset` is what the position says where the robot file's joint is at 0, in the position's
    own unit. `position_sign` and `torque_sign` are -1 where they count the other way than the robot
    file's joint; the first is the velocity's too.
    """

    joint: str
    torque_constant_nm_per_a: Annotated[Positive, Plausible(1e-3, 5e3, "N m/A")] | None = None
    gear_ratio: Annotated[float, Plausible(0.05, 1e5, "")] | None = None
    zero_offset: float = 0.0
    position_sign: Literal[1, -1] = 1
    torque_sign: Literal[1, -1] = 1

    @model_validator(mode="after")
    def _turning(self) -> JointReading:
        if self.gear_ratio == 0.0:
            raise ValueError("gear_ratio must not be 0")
        if self.gear_ratio is not None and self.gear_ratio < 0.0 and self.position_sign < 0:
            raise ValueError(
                "gear_ratio is negative and position_sign is -1: they cancel. State one sign"
            )
        return self


class JointStates(ConfigModel):
    """The messages of a ROS 2 bag or MCAP file: `sensor_msgs/msg/JointState`.

    `effort` says what its efforts are: torques, or currents of the motors. `topic` is needed where
    several have such messages, `names` (base to flange) where the messages do not name the joints
    as the robot file does. `joints` names those of the robot file's that are read otherwise than
    they stand there: a sign, a zero position, a gear, a torque constant.
    """

    effort: Literal["torque", "current"]
    topic: str | None = None
    names: tuple[str, ...] = ()
    joints: tuple[JointReading, ...] = ()

    @model_validator(mode="after")
    def _once(self) -> JointStates:
        for names in ([joint.joint for joint in self.joints], self.names):
            if len(set(names)) != len(names):
                raise ValueError("two joints have the same name")
        constants = [j.joint for j in self.joints if j.torque_constant_nm_per_a is not None]
        if constants and self.effort == "torque":
            raise ValueError(
                f"torque_constant_nm_per_a of {', '.join(constants)} belongs to currents: say"
                " effort: current, or leave it out"
            )
        return self


class ImportUnits(ConfigModel):
    """Units of the columns; everything becomes SI on the way in."""

    position: PositionUnit = "rad"
    velocity: VelocityUnit = "rad/s"
    current: Literal["A", "mA"] = "A"
    torque: Literal["Nm", "mNm", "N"] = "Nm"
    temperature: Literal["C", "K"] = "C"


class ImportJoint(JointReading):
    """One joint's columns, counted from 0.

    Torque comes from a `torque` column, or from a `current` column. `velocity` is optional: it is
    not used in place of the position's derivative, but compared with it, so that a wrong column,
    unit or clock is found. `temperature` is the drive's, for friction that depends on it: every
    joint has it, or none.
    """

    position: Column
    velocity: Column | None = None
    current: Column | None = None
    torque: Column | None = None
    temperature: Column | None = None

    @model_validator(mode="after")
    def _one_torque(self) -> ImportJoint:
        if (self.current is None) == (self.torque is None):
            raise ValueError("give either a torque column or a current column, not both or none")
        if self.current is None and self.torque_constant_nm_per_a is not None:
            raise ValueError("torque_constant_nm_per_a belongs to a current column: give both")
        return self


class DamageLimits(ConfigModel):
    """Beyond these a row is taken for damaged; link side, SI, any joint.

    Two neighbouring rows further apart than `speed` allows are a jump, and damage too, unless a
    long stretch of rows goes on from there.
    """

    position: Annotated[Positive, Plausible(0.05, 150.0, "rad or m")] = 100.0
    speed: Annotated[Positive, Plausible(1e-2, 60.0, "rad/s or m/s")] = 20.0
    torque: Annotated[Positive, Plausible(0.1, 5e5, "N m or N")] = 1e5


class RowRange(ConfigModel):
    """Rows to use, counted from 1 as an editor does; `last` is included."""

    first: Annotated[int, Field(ge=1)] = 1
    last: Annotated[int, Field(ge=1)] | None = None

    @model_validator(mode="after")
    def _ordered(self) -> RowRange:
        if self.last is not None and self.last <= self.first:
            raise ValueError(f"last {self.last} must be after first {self.first}")
        return self


class ImportMap(PhysicalFile, Derived):
    """How one kind of recording is laid out: CSV files by `columns`, bags by `joint_states`.

    `columns` is the number of columns of a sound row; a row with another number is damaged. Time is
    the column `time`, or the row's number over `rate_hz`. Where `further_files` are named, they
    follow the file on the command line, in this order; their columns are counted on from its own,
    and their values are interpolated to its time stamps.

    `left_out_limit` is the share of rows that may be left out as damaged; beyond it the import is
    refused. `period_s` says that the rows used hold whole periods of that length, which are then
    averaged; without it the recording is taken as not periodic and smoothed.

    `side: motor` says that all columns are the motors': positions are divided, torques multiplied
    by the robot's gear ratios (or a joint's own `gear_ratio`). Where the robot states a `coupling`
    C, these positions alpha become the joints' q = C alpha (5.18). With `side: link`, positions are
    the joints'. Torques are the actuators', seen from the link side, either way.
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
    def _one_layout(self) -> ImportMap:
        if self.joint_states is not None:
            given = self.model_fields_set & {"columns", "time", "rate_hz", "joints"}
            given |= self.model_fields_set & {"further_files", "delimiter", "decimal"}
            if given:
                raise ValueError(
                    f"joint_states has no {', '.join(sorted(given))}: its messages say what is what"
                )
            return self
        if self.columns is None or not self.joints:
            raise ValueError(
                "say what is where: columns and joints of a CSV file, or joint_states of a bag"
            )
        if (self.time is None) == (self.rate_hz is None):
            raise ValueError(
                "give either time (the column of time stamps) or rate_hz (rows per second)"
            )
        if self.rate_hz is not None and any(file.time for file in self.further_files):
            raise ValueError("with rate_hz rows are counted in every file: leave out their time")
        if self.decimal == self.delimiter:
            raise ValueError(
                f"decimal and delimiter are both {self.decimal!r}: where numbers have a decimal"
                " comma, say what stands between the columns, `delimiter: ';'`, tab or space"
            )
        return self

    @model_validator(mode="after")
    def _consistent(self) -> ImportMap:
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
                f"{', '.join(without)} has no temperature column, other joints have: give every"
                " joint one, or none"
            )
        return self

    def derived(self) -> dict[str, tuple[float, Plausible]]:
        """Return the zero offsets, which are in the unit and at the side of the positions."""
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
        """The joints' names, base to flange; none where `joint_states` leaves them to the robot."""
        return tuple(joint.joint for joint in self.joints)

    @property
    def first_columns(self) -> tuple[int, ...]:
        """Where the columns of each file begin, and where the last one's end."""
        widths = (self.columns or 0, *(file.columns for file in self.further_files))
        return (0, *accumulate(widths))

    def time_of(self, number: int) -> TimeColumn | None:
        """Return the time column of a file in its own count, 0 being the first; None by rate."""
        return self.time if number == 0 else self.further_files[number - 1].time or self.time

    def _time_columns(self) -> Iterator[tuple[str, int]]:
        widths = (self.columns or 0, *(file.columns for file in self.further_files))
        for number, width in enumerate(widths):
            time = self.time_of(number)
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
        reference: The name of a bundled map, or a path to one.

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
                f"{tree.where(('joint_states', 'names'))}: {len(states.names)} names, robot"
                f" {robot.name} has {len(named)} joints: name one a joint, base to flange",
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
            f"{tree.where(('joints',))}: joints are {', '.join(named)}, robot"
            f" {robot.name} has {', '.join(robot.joint_names)}: name them alike, base to flange",
            code="RID-IMPORT-JOINTS",
        )
    return import_map, robot
