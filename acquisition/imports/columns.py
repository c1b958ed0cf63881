"""`ImportColumns`: selects columns and converts their numbers to `ImportRows` in SI units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from acquisition.imports.table import ImportTable
from acquisition.maps.import_joint import ImportJoint
from acquisition.maps.import_map import ImportMap
from acquisition.maps.import_units import RATED
from acquisition.maps.time_column import numbered
from config.arrays import PIECE_ROWS, BoolArray, FloatArray, IntArray, release
from config.column_file import ColumnFile, each_column, selected_rows
from config.errors import ConfigError
from config.plausible import ZERO_CELSIUS_K
from config.robot.robot import Joint, RobotDescription

_TURN = 2.0 * math.pi
_POSITION = {"rad": 1.0, "deg": _TURN / 360.0, "rev": _TURN, "m": 1.0, "mm": 1e-3}
_VELOCITY = {
    "rad/s": 1.0,
    "deg/s": _TURN / 360.0,
    "rpm": _TURN / 60.0,
    "m/s": 1.0,
    "mm/s": 1e-3,
}
_CURRENT = {"A": 1.0, "mA": 1e-3}
_TORQUE = {"Nm": 1.0, "mNm": 1e-3, "N": 1.0}
_ZERO_K = {"C": ZERO_CELSIUS_K, "K": 0.0}


@dataclass(frozen=True, eq=False)
class ImportRows:
    """Rows of a recording in SI units, link side.

    If the map's side is motor and the robot has a coupling, positions, velocities and commands are
    still those of the actuators.

    Attributes:
        row: Shape (rows,). Line numbers in the file, from 1.
        time_s: Shape (rows,). Time stamps [s].
        position, velocity, torque: Shape (rows, joints). Position [rad or m], velocity [rad/s or
            m/s], torque [N m or N]; a velocity that was not recorded is NaN.
        temperature: Shape (rows, joints or 0). Temperatures [K]; no columns if none were recorded.
        command: Shape (rows, joints or 0). Velocity commands [rad/s or m/s]; no columns if none
            were recorded.
    """

    row: IntArray
    time_s: FloatArray
    position: FloatArray
    velocity: FloatArray
    torque: FloatArray
    temperature: FloatArray
    command: FloatArray

    def keep(self, mask: BoolArray) -> ImportRows:
        """Return the selected rows; without a copy if these are all rows."""
        if mask.all():
            return self
        return ImportRows(*(selected_rows(getattr(self, each.name), mask) for each in fields(self)))


@dataclass(frozen=True, eq=False)
class ImportColumns:
    """Columns in use: positions, torques, velocities, temperatures and commands of all joints.

    Attributes:
        columns: Column numbers in the files; a joint without velocity has its position column
            instead. Temperatures and commands are present for all joints or for none.
        factors, offsets: Shape (columns,). SI value at the link side = factor * number + offset;
            NaN for a velocity that was not recorded.
        temperatures: Number of columns of temperatures.
        coupling: Shape (n, n). Coupling matrix C in q = C alpha, if the positions are those of the
            actuators (alpha).
    """

    columns: tuple[int, ...]
    factors: FloatArray
    offsets: FloatArray
    temperatures: int
    coupling: FloatArray | None

    @classmethod
    def of(cls, import_map: ImportMap, robot: RobotDescription | None) -> ImportColumns:
        """Return the columns of a map that has numbers instead of the columns' names.

        The robot file gives gear ratios and torque constants that are missing in the map.

        Raises:
            ConfigError: A required value is in neither file, or the joints have other names in the
                robot file.
        """
        units, joints = import_map.units, import_map.joints
        known = [_described_joint(import_map, joint, robot) for joint in joints]
        gears = [_gear_ratio(import_map, *pair) for pair in zip(joints, known, strict=True)]
        columns = [numbered(joint.position) for joint in joints]
        turns = [gear * joint.position_sign for gear, joint in zip(gears, joints, strict=True)]
        factors = [
            _unit_value(units.position, _POSITION, _increment(joint)) / turn
            for joint, turn in zip(joints, turns, strict=True)
        ]
        offsets = [-f * joint.zero_offset for f, joint in zip(factors, joints, strict=True)]
        for joint, gear, description in zip(joints, gears, known, strict=True):
            if joint.torque is not None:
                columns.append(numbered(joint.torque))
                torque = _unit_value(
                    units.torque, _TORQUE, _rated(units.torque, joint.rated_torque_nm)
                )
                factors.append(torque * gear * joint.torque_sign)
            else:
                columns.append(numbered(joint.position if joint.current is None else joint.current))
                constant = _torque_constant(import_map, joint, gear, description)
                current = _unit_value(
                    units.current, _CURRENT, _rated(units.current, joint.rated_current_a)
                )
                factors.append(current * constant * joint.torque_sign)
        for joint, turn in zip(joints, turns, strict=True):
            columns.append(numbered(joint.position if joint.velocity is None else joint.velocity))
            factor = math.nan
            if joint.velocity is not None:
                factor = _unit_value(units.velocity, _VELOCITY, _increment(joint))
            factors.append(factor / turn)
        orders = [
            (numbered(j.velocity_command), _unit_value(units.velocity, _VELOCITY, _increment(j)))
            for j in joints
            if j.velocity_command is not None
        ]
        warmths = [numbered(j.temperature) for j in joints if j.temperature is not None]
        offsets += [0.0] * (len(columns) - len(offsets))
        coupling = None
        if import_map.side == "motor" and robot is not None and robot.coupling is not None:
            coupling = np.array(robot.coupling)
        return cls(
            columns=(*columns, *warmths, *(column for column, _ in orders)),
            factors=np.array(
                [
                    *factors,
                    *(1.0 for _ in warmths),
                    *(unit / turn for (_, unit), turn in zip(orders, turns, strict=False)),
                ]
            ),
            offsets=np.array(
                [*offsets, *(_ZERO_K[units.temperature] for _ in warmths), *(0.0 for _ in orders)]
            ),
            temperatures=len(warmths),
            coupling=coupling,
        )

    def rows(self, table: ImportTable, joints: int) -> ImportRows:
        """Return the rows of a table in SI units; the table's values are overwritten."""
        warmth = 3 * joints + self.temperatures
        with np.errstate(over="ignore", invalid="ignore"):
            for number, column in enumerate(each_column(table.values)):
                column *= self.factors[number]
                column += self.offsets[number]
        ends = (joints, 2 * joints, 3 * joints, warmth)
        position, torque, velocity, temperature, command = np.split(table.values, ends, axis=1)
        return ImportRows(table.row, table.time_s, position, velocity, torque, temperature, command)

    def joint_positions(self, read: FloatArray) -> FloatArray:
        """Return joint positions for positions of the file, (samples, n): q = C alpha (5.18)."""
        if self.coupling is None:
            return read
        file = ColumnFile(len(self.coupling), len(read))
        for first in range(0, len(read), PIECE_ROWS):
            file.append(read[first : first + PIECE_ROWS] @ self.coupling.T)
            release(read)
        return file.table()


def _unit_value(unit: str, fixed: Mapping[str, float], of_joint: float | None) -> float:
    """Return the SI value of a unit; `of_joint` is that of a unit that depends on the joint."""
    if unit in fixed:
        return fixed[unit]
    assert of_joint is not None  # the map's validation requires this value
    return of_joint


def _increment(joint: ImportJoint) -> float | None:
    """Return the angle of one increment of the encoder [rad]; None if the map states none."""
    return None if joint.increments_per_rev is None else _TURN / joint.increments_per_rev


def _rated(unit: str, rated: float | None) -> float | None:
    """Return the value of one per mille or percent of a rated value; None if it is unknown."""
    return None if rated is None else RATED[unit] * rated


def _described_joint(
    import_map: ImportMap, joint: ImportJoint, robot: RobotDescription | None
) -> Joint | None:
    """Return a joint's entry in the robot file; None without a robot."""
    if robot is None:
        return None
    if robot.joint_names != import_map.joint_names:
        raise ConfigError(
            f"map {import_map.name!r} has joints {', '.join(import_map.joint_names)}, robot"
            f" {robot.name!r} has {', '.join(robot.joint_names)}: use the same names, from base"
            " to flange",
            code="RID-IMPORT-JOINTS",
        )
    return robot.joints[robot.joint_names.index(joint.joint)]


def _gear_ratio(import_map: ImportMap, joint: ImportJoint, description: Joint | None) -> float:
    """Return the gear ratio between the columns' side and the link side; 1 for the link side."""
    if joint.gear_ratio is not None:
        return joint.gear_ratio
    if import_map.side == "link":
        return 1.0
    if description is None:
        raise ConfigError(
            f"map {import_map.name!r}: side is motor, but joint {joint.joint!r} has no"
            " gear_ratio: add it to the map, or read the file together with its robot",
            code="RID-IMPORT-MOTOR-SIDE",
        )
    return description.gear_ratio


def _torque_constant(
    import_map: ImportMap, joint: ImportJoint, gear: float, description: Joint | None
) -> float:
    """Return the torque at the link side per ampere; the robot file gives it for this side."""
    if joint.torque_constant_nm_per_a is not None:
        return joint.torque_constant_nm_per_a * gear
    if description is None or description.torque_constant_nm_per_a is None:
        raise ConfigError(
            f"map {import_map.name!r}: the current of joint {joint.joint!r} has no"
            " torque_constant_nm_per_a in the map or in the robot file: add the constant",
            code="RID-IMPORT-MOTOR-SIDE",
        )
    return math.copysign(description.torque_constant_nm_per_a, gear)
