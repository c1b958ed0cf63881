"""`MeasuredPoses`: joint positions at rest, each with the point that an instrument measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.tracker.named_columns import ROW, NamedColumns, read_named_columns
from acquisition.tracker.tracker_file import (
    LENGTHS,
    read_points,
    read_sigma,
    read_valid,
)
from config.arrays import BoolArray, FloatArray, IntArray, freeze
from config.errors import ConfigError, DataQualityError
from config.robot.robot import Joint, RobotDescription

ANGLES: Final = {"rad": 1.0, "deg": np.pi / 180.0}
LOAD: Final = "load_kg"
NEAR: Final = 0.01
"""Largest difference between a pose of the table and its rest in a run [rad or m]."""
SLACK: Final = 0.02
"""Distance beyond a position limit up to which a pose is accepted [rad or m]; with wrong units or
another zero, poses are far outside."""


@dataclass(frozen=True, eq=False)
class MeasuredPoses:
    """Poses at rest with the measured positions of one point on the last link.

    Attributes:
        name: Name of the file, for messages.
        rows: Shape (poses,). Line of each pose in the file.
        position: Shape (poses, n). Joint positions from the encoders [rad or m].
        point_m: Shape (poses, 3). The point in the frame of the instrument [m].
        load_kg: Shape (poses,). Known mass on the flange, 0 for none [kg].
        sigma_m: Shape (poses,). Standard deviation of each coordinate [m]; None if not stated.
        left_out: Number of rows that the file marks as not valid.
    """

    name: str
    rows: IntArray
    position: FloatArray
    point_m: FloatArray
    load_kg: FloatArray
    sigma_m: FloatArray | None = None
    left_out: int = 0

    def __post_init__(self) -> None:
        count = len(self.rows)
        freeze(self, DataQualityError, (count,), "rows", dtype=np.int64)
        freeze(self, DataQualityError, (count, None), "position")
        freeze(self, DataQualityError, (count, 3), "point_m")
        freeze(self, DataQualityError, (count,), "load_kg", "sigma_m")

    def __len__(self) -> int:
        return len(self.rows)

    def keep(self, kept: BoolArray) -> MeasuredPoses:
        """Return the selected poses."""
        return replace(
            self,
            rows=self.rows[kept],
            position=self.position[kept],
            point_m=self.point_m[kept],
            load_kg=self.load_kg[kept],
            sigma_m=None if self.sigma_m is None else self.sigma_m[kept],
        )


def read_measured_poses(
    path: Path, robot: RobotDescription, rests: FloatArray | None = None
) -> MeasuredPoses:
    """Return the poses in a text table.

    The table has a column for each joint, with the joint's name (rad or m) or with a unit
    (`axis1_deg`, `axis1_rad`, `lift_mm`), and the measured point in `x_m`, `y_m`, `z_m` or `x_mm`,
    `y_mm`, `z_mm`. Optional columns are `sigma_m` or `sigma_mm`, `load_kg` and `valid`.

    Args:
        path: The file.
        robot: The robot.
        rests: Shape (rests, n). Joint positions at the rests of the runs in which the points were
            measured. Each pose gets the closest rest; if the table has no joint columns, the poses
            have the order of the rests.

    Raises:
        ConfigError: The file cannot be read, a column is missing, or a value is not a number or out
            of range; the message names the line.
        DataQualityError: A pose has no rest near it, or there are more or fewer poses than rests.
    """
    columns = read_named_columns(path)
    valid = read_valid(columns)
    ordered = None
    if rests is not None and not _has_joints(columns, robot):
        ordered = _ordered_rests(columns, rests)[valid]
    columns = columns.keep(valid)
    position = ordered
    if position is None:
        position = np.column_stack([_joint_positions(columns, joint) for joint in robot.joints])
        if rests is not None:
            position = _closest_rests(columns, position, rests)
    return MeasuredPoses(
        str(path),
        columns.rows,
        position,
        read_points(columns),
        _loads(columns),
        read_sigma(columns),
        int(len(valid) - valid.sum()),
    )


def _has_joints(columns: NamedColumns, robot: RobotDescription) -> bool:
    names = {name.rsplit("_", 1)[0] for name in columns.names} | set(columns.names)
    return not names.isdisjoint(robot.joint_names)


def _ordered_rests(columns: NamedColumns, rests: FloatArray) -> FloatArray:
    """Return the rests as the positions of all rows of the table."""
    if len(columns.rows) != len(rests):
        raise DataQualityError(
            f"{columns.path}: has {len(columns.rows)} rows, but the runs have {len(rests)} rests:"
            " give one row for each rest (valid 0 for a rest without a point), or joint columns",
            code="RID-TRACKER-RESTS",
        )
    return rests


def _closest_rests(columns: NamedColumns, position: FloatArray, rests: FloatArray) -> FloatArray:
    """Return the measured position of the rest that is closest to each pose."""
    distance = np.abs(position[:, np.newaxis] - rests).max(axis=2)
    closest = distance.argmin(axis=1)
    far = np.flatnonzero(distance.min(axis=1) > NEAR)
    if far.size:
        raise DataQualityError(
            f"{columns.path}:{columns.rows[far[0]]}: no rest of the runs is within {NEAR:g} rad or"
            f" m of this pose; the closest differs by {distance[far[0]].min():.3g}",
            code="RID-TRACKER-RESTS",
        )
    return np.asarray(rests[closest])


def joint_columns(joint: Joint) -> dict[str, float]:
    """Return the possible names of a joint's column, each with the factor of its unit."""
    units = ANGLES if joint.type == "revolute" else LENGTHS
    return {joint.name: 1.0, **{f"{joint.name}_{unit}": size for unit, size in units.items()}}


def _joint_positions(columns: NamedColumns, joint: Joint) -> FloatArray:
    name, factor = columns.choose(joint_columns(joint), f"the position of joint {joint.name}")
    position = columns.numbers(name) * factor
    low, high = joint.limits.position_min, joint.limits.position_max
    wrong = np.flatnonzero((position < low - SLACK) | (position > high + SLACK))
    if wrong.size:
        unit = joint.unit
        raise ConfigError(
            f"{columns.path}:{columns.rows[wrong[0]]}: {name} is {position[wrong[0]]:.6g} {unit},"
            f" outside the joint's limits {low:g} to {high:g} {unit}: correct the row, or the unit"
            " in the column's name",
            code=ROW,
        )
    return np.asarray(position)


def _loads(columns: NamedColumns) -> FloatArray:
    if LOAD not in columns.names:
        return np.zeros(len(columns.rows))
    loads = columns.numbers(LOAD)
    wrong = np.flatnonzero((loads < 0.0) | (loads > 3e3))
    if wrong.size:
        raise ConfigError(
            f"{columns.path}:{columns.rows[wrong[0]]}: {LOAD} is {loads[wrong[0]]:g} kg: it must"
            " be 0 to 3000 kg",
            code=ROW,
        )
    return np.asarray(loads)
