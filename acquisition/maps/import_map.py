"""`ImportMap`: description of another program's recording: columns, units and signs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import accumulate
from typing import Annotated, Literal

from pydantic import Field, model_validator

from acquisition.maps.command_timing import CommandTiming
from acquisition.maps.import_joint import COLUMN_QUANTITIES, ImportJoint, JointReading
from acquisition.maps.import_plate import ImportPlate
from acquisition.maps.import_units import RATED, ImportUnits
from acquisition.maps.time_column import MOST_COLUMNS, Column, TimeColumn
from acquisition.maps.torque_meaning import TorqueMeaning, refuse_other_quantity
from config.cell.torque_filter import ButterworthFilter
from config.errors import ConfigError
from config.formats.yaml_tree import parse_yaml
from config.load import read_named, validate
from config.model import ConfigModel, refuse_same_names
from config.plausible import Derived, PhysicalFile, Plausible
from config.quantities import MOST_JOINTS, Positive
from config.robot.robot import RobotDescription

Columns = Annotated[int, Field(ge=2, le=MOST_COLUMNS)]

_LARGEST_OFFSET = {
    "rad": 15.0, "deg": 900.0, "rev": 2.5, "m": 50.0, "mm": 5e4, "increments": 1e9
}  # fmt: skip
_LARGEST_GEAR = 5e3


class FurtherFile(ConfigModel):
    """An additional file, read in the same way as the first one.

    Attributes:
        columns: Number of columns of this file; their numbers continue those of the previous file.
            Default: the number of names in the file's header.
        time: Column of the time stamps, counted in this file; default: as in the first file.
    """

    columns: Columns | None = None
    time: TimeColumn | None = None


class JointStates(ConfigModel):
    """Description of a ROS bag or MCAP file with `sensor_msgs/msg/JointState` messages.

    Attributes:
        effort: Quantity in the messages' `effort`: a torque or a motor current.
        topic: Topic to read; necessary if several topics have such messages.
        names: Names of the joints in the messages, base to flange; necessary if they differ from
            those in the robot file.
        joints: Joints whose sign, zero position, gear ratio or torque constant differs from the
            robot file.
    """

    effort: Literal["torque", "current"]
    topic: str | None = None
    names: tuple[str, ...] = ()
    joints: tuple[JointReading, ...] = ()

    @model_validator(mode="after")
    def _check_names(self) -> JointStates:
        for names in ([joint.joint for joint in self.joints], self.names):
            refuse_same_names(names, "joints")
        constants = [j.joint for j in self.joints if j.torque_constant_nm_per_a is not None]
        if constants and self.effort == "torque":
            raise ValueError(
                f"torque_constant_nm_per_a of {', '.join(constants)} applies to currents only:"
                " set effort: current, or remove it"
            )
        return self


class DamageLimits(ConfigModel):
    """Limits beyond which a row counts as damaged; link side, for every joint.

    Attributes:
        position: Largest absolute position [rad or m].
        speed: Largest absolute speed [rad/s or m/s]. The position jumps if it changes more than 1.5
            times as fast between neighbouring rows. Rows that are reached only by a jump also count
            as damaged; a long stretch of rows is kept if a wrong time stamp can explain its jump.
        torque: Largest absolute torque or force [N m or N].
    """

    position: Annotated[Positive, Plausible(0.05, 150.0, "rad or m")] = 100.0
    speed: Annotated[Positive, Plausible(1e-2, 60.0, "rad/s or m/s")] = 20.0
    torque: Annotated[Positive, Plausible(0.1, 5e5, "N m or N")] = 1e5


class RowRange(ConfigModel):
    """Rows to use, counted from 1 as in an editor.

    Attributes:
        first: First row to use.
        last: Last row to use; default: the last row of the file.
    """

    first: Annotated[int, Field(ge=1)] = 1
    last: Annotated[int, Field(ge=1)] | None = None

    @model_validator(mode="after")
    def _check_order(self) -> RowRange:
        if self.last is not None and self.last <= self.first:
            raise ValueError(f"last {self.last} must be greater than first {self.first}")
        return self


class ImportMap(PhysicalFile, Derived):
    """Layout of one kind of recording: `columns` for CSV files, `joint_states` for bags.

    Attributes:
        name: Name of the map, which runs and reports show.
        robot: A bundled robot file, or a path relative to the map.
        columns: Number of columns of a row; a row with another number is damaged. Left out,
            the number of names in the header.
        delimiter: Separator of the columns.
        decimal: Decimal separator. If it is also the delimiter, numbers must be quoted.
        header_rows: Number of rows before the first row of numbers. The last of these rows is the
            header, if the map names columns or leaves out `columns`.
        empty_cells: Meaning of empty cells and `nan` in the columns of the joints. `damaged`: the
            row is left out. `interpolate`: several topics were written into one file, each in rows
            of its own; the rows with a position of the first joint are kept, and the other columns
            are interpolated to their time stamps.
        time: Column of the time stamps; give this or `rate_hz`.
        rate_hz: Number of rows per second, for a file without time stamps [Hz].
        further_files: Files that follow the first one on the command line, in this order. Their
            values are interpolated to the time stamps of the first file.
        joint_states: Description of a bag; it replaces all keys that describe a CSV file.
        units: Units of the columns.
        side: Side of the gears on which the values were measured. `motor`: positions are divided,
            and torques multiplied, by the gear ratios; with a `coupling` C in the robot file, these
            positions alpha become those of the joints, q = C alpha (5.18). `link`: positions are
            those of the joints. In both cases torques are those of the actuators, referred to the
            link side.
        torques: Meaning of the torques or currents; left out, those of the motors are assumed.
        joints: Columns of each joint, base to flange.
        command_timing: Time at which the drives use the velocity commands.
        torque_filter: Analog low-pass of the torques; it is compensated as for a cell.
        plate: Columns and description of a force plate under the robot.
        plausible: Limits beyond which a row counts as damaged.
        left_out_limit: Largest fraction of damaged rows; an import with a larger fraction is
            refused.
        rows: Rows to use.
        period_s: Duration of one period, if the rows contain whole periods [s]. Periods are
            averaged, and the positions must repeat; without this key the recording is smoothed
            instead.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][\w.-]{0,63}$")
    robot: str
    columns: Columns | None = None
    delimiter: Literal[",", ";", "tab", "space"] = ","
    decimal: Literal[".", ","] = "."
    header_rows: Annotated[int, Field(ge=0, le=1000)] = 0
    empty_cells: Literal["damaged", "interpolate"] = "damaged"
    time: TimeColumn | None = None
    rate_hz: Annotated[Positive, Plausible(1.0, 1e5, "Hz")] | None = None
    further_files: tuple[FurtherFile, ...] = Field(default=(), max_length=3)
    joint_states: JointStates | None = None
    units: ImportUnits = ImportUnits()
    side: Literal["link", "motor"] = "link"
    torques: TorqueMeaning | None = None
    joints: Annotated[tuple[ImportJoint, ...], Field(max_length=MOST_JOINTS)] = ()
    command_timing: CommandTiming | None = None
    torque_filter: ButterworthFilter | None = None
    plate: ImportPlate | None = None
    plausible: DamageLimits = DamageLimits()
    left_out_limit: Annotated[float, Field(ge=0.0, le=0.5)] = 0.02
    rows: RowRange = RowRange()
    period_s: Annotated[Positive, Plausible(0.05, 3600.0, "s")] | None = None

    @model_validator(mode="after")
    def _check_layout(self) -> ImportMap:
        if self.joint_states is not None:
            given = self.model_fields_set & {"columns", "time", "rate_hz", "joints"}
            given |= self.model_fields_set & {"further_files", "delimiter", "decimal"}
            given |= self.model_fields_set & {"empty_cells", "plate"}
            if given:
                raise ValueError(
                    f"joint_states cannot be combined with {', '.join(sorted(given))}: these keys"
                    " are for CSV files only. Remove them"
                )
            return self
        if not self.joints:
            raise ValueError("no layout: give joints for a CSV file, or joint_states for a bag")
        if (self.time is None) == (self.rate_hz is None):
            raise ValueError(
                "give either time (the column of time stamps) or rate_hz (rows per second)"
            )
        if self.rate_hz is not None and any(file.time for file in self.further_files):
            raise ValueError(
                "with rate_hz, rows are counted in every file: remove `time` of the further files"
            )
        return self

    @model_validator(mode="after")
    def _check_columns(self) -> ImportMap:
        names = self.joint_names
        refuse_same_names(names, "joints")
        if self.joints and not self.header_rows and None in self.widths:
            by_number = [role for role, column in self._joint_columns() if isinstance(column, int)]
            if by_number:
                raise ValueError(
                    f"{by_number[0]} is given by its number: give `columns`, the number of columns"
                    " of a row, or `header_rows` if the file has a header"
                )
        self.check_numbers()
        for quantity in ("temperature", "velocity_command"):
            without = [each.joint for each in self.joints if getattr(each, quantity) is None]
            if 0 < len(without) < len(self.joints):
                raise ValueError(
                    f"{', '.join(without)} has no {quantity} column, but other joints have one:"
                    f" give a {quantity} column for every joint, or for none"
                )
        if self.command_timing is not None and not self.has_commands:
            raise ValueError("command_timing needs a velocity_command column for every joint")
        return self

    @model_validator(mode="after")
    def _check_torque_meaning(self) -> ImportMap:
        torque = not self.has_currents or any(each.torque is not None for each in self.joints)
        refuse_other_quantity(self.torques, self.has_currents, torque, self.side)
        return self

    @model_validator(mode="after")
    def _check_drive_units(self) -> ImportMap:
        """Check that the joints have exactly the conversion values that the units need."""
        units, states = self.units, self.joint_states
        joints: Sequence[JointReading] = self.joints if states is None else states.joints
        increments: list[str] = [
            unit
            for unit in (units.position, units.velocity)
            if unit in ("increments", "increments/s")
        ]
        needs: dict[str, list[str]] = {
            "increments_per_rev": increments,
            "rated_torque_nm": [units.torque] if units.torque in RATED else [],
            "rated_current_a": [units.current] if units.current in RATED else [],
        }
        columns = {
            "increments_per_rev": "position",
            "rated_torque_nm": "torque",
            "rated_current_a": "current",
        }
        for key, needing in needs.items():
            if needing and states is not None:
                raise ValueError(f"unit {needing[0]} is for CSV files, not for joint_states")
            for joint in joints:
                given = getattr(joint, key) is not None
                has_column = getattr(joint, columns[key], None) is not None
                if given and not (needing and has_column):
                    raise ValueError(
                        f"{key} of {joint.joint} is not used, because no unit needs it: remove it"
                    )
                if needing and has_column and not given:
                    raise ValueError(f"unit {needing[0]}: give {key} of {joint.joint}")
        return self

    def derived(self) -> dict[str, tuple[float, Plausible]]:
        """Return the zero offsets, in unit and side of the positions, with plausible ranges."""
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
        """Joint names, base to flange; empty with `joint_states`, since the robot file has them."""
        return tuple(joint.joint for joint in self.joints)

    @property
    def has_commands(self) -> bool:
        """True if the map has velocity commands."""
        return any(joint.velocity_command is not None for joint in self.joints)

    @property
    def has_currents(self) -> bool:
        """True if a joint has a current instead of a torque."""
        if self.joint_states is not None:
            return self.joint_states.effort == "current"
        return any(joint.current is not None for joint in self.joints)

    @property
    def widths(self) -> tuple[int | None, ...]:
        """Number of columns of each file; None if its header defines it."""
        return (self.columns, *(file.columns for file in self.further_files))

    @property
    def first_columns(self) -> tuple[int, ...]:
        """Number of each file's first column; the last element is the number of all columns."""
        return (0, *accumulate(width or 0 for width in self.widths))

    def time_column_of_file(self, number: int) -> TimeColumn | None:
        """Return the time column of a file, counted within the file; None with `rate_hz`."""
        return self.time if number == 0 else self.further_files[number - 1].time or self.time

    @property
    def time_columns(self) -> tuple[Column, ...]:
        """Columns of the time stamps of all files."""
        times = [self.time_column_of_file(number) for number in range(len(self.widths))]
        return tuple(column for time in times if time is not None for column in time.columns)

    @property
    def column_roles(self) -> dict[Column, str]:
        """Quantity of each column of a joint or plate, such as `torque of axis1`."""
        return {column: role for role, column in self._joint_columns()}

    def check_numbers(self) -> None:
        """Check that the columns with known numbers exist, and that each has only one role.

        Raises:
            ValueError: A column does not exist or has two roles.
        """
        used: dict[Column, str] = {}
        for role, column in (*self._time_columns(), *self._joint_columns()):
            last = self.first_columns[-1] - 1
            if isinstance(column, int) and None not in self.widths and column > last:
                raise ValueError(f"{role} is column {column}, but rows have columns 0 to {last}")
            if column in used:
                raise ValueError(f"column {column} is both {used[column]} and {role}")
            used[column] = role

    def _time_columns(self) -> Iterator[tuple[str, int]]:
        """Yield the role of each time column with a known number, and this number in all files."""
        for number, width in enumerate(self.widths):
            time = self.time_column_of_file(number)
            if time is None or width is None:
                continue
            role = f"time of file {number + 1}" if number else "time"
            for column in time.columns:
                if isinstance(column, str):
                    continue
                if column >= width:
                    raise ValueError(
                        f"{role} is column {column}, but rows of that file have columns 0 to"
                        f" {width - 1}"
                    )
                yield role, self.first_columns[number] + column

    def _joint_columns(self) -> Iterator[tuple[str, Column]]:
        for joint in self.joints:
            for quantity in COLUMN_QUANTITIES:
                column: Column | None = getattr(joint, quantity)
                if column is not None:
                    yield f"{quantity} of {joint.joint}", column
        if self.plate is not None:
            for name, column in zip(self.plate.reading_names, self.plate.columns, strict=True):
                yield f"{name} of the force plate", column


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
                f" {robot.name} has {len(named)} joints: give one name per joint, from base to"
                " flange, as in the messages",
                code="RID-IMPORT-JOINTS",
            )
        for number, joint in enumerate(states.joints):
            if joint.joint not in named:
                where = tree.where(("joint_states", "joints", number, "joint"))
                raise ConfigError(
                    f"{where}: robot {robot.name} has no joint {joint.joint!r}: use one of"
                    f" {', '.join(named)}",
                    code="RID-IMPORT-JOINTS",
                )
    if named != robot.joint_names:
        raise ConfigError(
            f"{tree.where(('joints',))}: joints are {', '.join(named)}, but robot {robot.name}"
            f" has {', '.join(robot.joint_names)}: use the same names, from base to flange",
            code="RID-IMPORT-JOINTS",
        )
    return import_map, robot
