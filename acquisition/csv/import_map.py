"""`ImportMap`: how to read someone else's recording (CSV) - which column is what, in which unit."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from config.errors import ConfigError
from config.formats.yaml_tree import parse_yaml
from config.load import read_named, validate
from config.model import ConfigModel
from config.robot.robot import Positive, RobotDescription

Column = Annotated[int, Field(ge=0, lt=10_000)]

PositionUnit = Literal["rad", "deg", "rev", "m", "mm"]
VelocityUnit = Literal["rad/s", "deg/s", "rpm", "m/s", "mm/s"]


class TimeColumn(ConfigModel):
    """The column of time stamps, and its unit. Steps may vary: the stamps are the truth."""

    column: Column
    unit: Literal["s", "ms", "us"] = "s"


class ImportUnits(ConfigModel):
    """Units of the columns; everything becomes SI on the way in."""

    position: PositionUnit = "rad"
    velocity: VelocityUnit = "rad/s"
    current: Literal["A", "mA"] = "A"
    torque: Literal["Nm", "mNm", "N"] = "Nm"
    temperature: Literal["C", "K"] = "C"


class ImportJoint(ConfigModel):
    """One joint's columns, counted from 0.

    Torque comes from a `torque` column, or from a `current` column times
    `torque_constant_nm_per_a`; without that, times the link-side constant that the robot file
    states. Where a joint's columns are its motor's, `gear_ratio` (motor turns per joint turn,
    negative where the motor turns against the joint) brings them to the link side; the map's torque
    constant is then the motor's too. `velocity` is optional: it is not used in place of the
    position's derivative, but compared with it, so that a wrong column or unit is found.
    `temperature` is the drive's, for friction that depends on it: every joint has it, or none.
    """

    joint: str
    position: Column
    velocity: Column | None = None
    current: Column | None = None
    torque: Column | None = None
    temperature: Column | None = None
    torque_constant_nm_per_a: Positive | None = None
    gear_ratio: float | None = None

    @model_validator(mode="after")
    def _one_torque(self) -> ImportJoint:
        if (self.current is None) == (self.torque is None):
            raise ValueError("give either a torque column or a current column, not both or none")
        if self.current is None and self.torque_constant_nm_per_a is not None:
            raise ValueError("torque_constant_nm_per_a belongs to a current column: give both")
        if self.gear_ratio == 0.0:
            raise ValueError("gear_ratio must not be 0")
        return self


class Plausible(ConfigModel):
    """Beyond these a row is taken for damaged; link side, SI, any joint.

    Two neighbouring rows further apart than `speed` allows are a jump, and damage too.
    """

    position: Positive = 100.0
    speed: Positive = 20.0
    torque: Positive = 1e5


class RowRange(ConfigModel):
    """Rows to use, counted from 1 as an editor does; `last` is included."""

    first: Annotated[int, Field(ge=1)] = 1
    last: Annotated[int, Field(ge=1)] | None = None

    @model_validator(mode="after")
    def _ordered(self) -> RowRange:
        if self.last is not None and self.last <= self.first:
            raise ValueError(f"last {self.last} must be after first {self.first}")
        return self


class ImportMap(ConfigModel):
    """How one kind of CSV file is laid out.

    `columns` is the number of columns of a sound row; a row with another number is damaged.
    `period_s` says that the rows used hold whole periods of that length, which are then averaged;
    without it the recording is taken as not periodic and smoothed.

    `side: motor` says that all columns are the motors': positions are divided, torques multiplied
    by the robot's gear ratios (or a joint's own `gear_ratio`). Where the robot states a `coupling`
    C, these positions alpha become the joints' q = C alpha (5.18). With `side: link`, positions are
    the joints'. Torques are the actuators', seen from the link side, either way.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][\w.-]{0,63}$")
    robot: str
    columns: Annotated[int, Field(ge=2, le=10_000)]
    delimiter: Literal[",", ";", "tab", "space"] = ","
    decimal: Literal[".", ","] = "."
    header_rows: Annotated[int, Field(ge=0, le=1000)] = 0
    time: TimeColumn
    units: ImportUnits = ImportUnits()
    side: Literal["link", "motor"] = "link"
    joints: tuple[ImportJoint, ...] = Field(min_length=1)
    plausible: Plausible = Plausible()
    rows: RowRange = RowRange()
    period_s: Positive | None = None

    @model_validator(mode="after")
    def _consistent(self) -> ImportMap:
        if self.decimal == self.delimiter:
            raise ValueError("decimal and delimiter must not be the same character")
        names = self.joint_names
        if len(set(names)) != len(names):
            raise ValueError("two joints have the same name")
        used: dict[int, str] = {self.time.column: "time"}
        for joint in self.joints:
            for quantity in ("position", "velocity", "current", "torque", "temperature"):
                column: int | None = getattr(joint, quantity)
                if column is None:
                    continue
                role = f"{quantity} of {joint.joint}"
                if column >= self.columns:
                    raise ValueError(
                        f"{role} is column {column}, but rows have columns 0 to {self.columns - 1}"
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

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints' names, base to flange."""
        return tuple(joint.joint for joint in self.joints)


def load_import_map(reference: str) -> tuple[ImportMap, RobotDescription]:
    """Load an import map and the robot that it names.

    Parameters
    ----------
    reference : str
        The name of a bundled map, or a path to one.

    Raises
    ------
    ConfigError
        A file is missing or invalid, or the joints do not match.
    """
    text, name, folder = read_named(reference, "maps", None)
    tree = parse_yaml(text, name)
    import_map = validate(tree, ImportMap)
    robot_text, robot_name, _ = read_named(import_map.robot, "robots", folder)
    robot = validate(parse_yaml(robot_text, robot_name), RobotDescription)
    if import_map.joint_names != robot.joint_names:
        raise ConfigError(
            f"{tree.where(('joints',))}: joints are {', '.join(import_map.joint_names)}, robot"
            f" {robot.name} has {', '.join(robot.joint_names)}: name them alike, base to flange"
        )
    return import_map, robot
