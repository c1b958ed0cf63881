"""`TrackedPoint`: the positions of a point over time, from the file of a laser tracker."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.tracker.named_columns import ROW, NamedColumns, read_named_columns
from config.arrays import BoolArray, FloatArray, freeze
from config.errors import ConfigError, DataQualityError

LENGTHS: Final = {"m": 1.0, "mm": 1e-3}
FARTHEST_M: Final = 500.0
"""Largest coordinate that counts as a measurement; trackers reach about 80 m."""
LARGEST_SIGMA_M: Final = 0.1
FEWEST_ROWS: Final = 2


@dataclass(frozen=True, eq=False)
class TrackedPoint:
    """Positions of a point over time, in the frame and on the clock of the instrument.

    Attributes:
        time_s: Shape (rows,). Time stamps of the instrument, increasing [s].
        point_m: Shape (rows, 3). The point in the frame of the instrument [m].
        sigma_m: Shape (rows,). Standard deviation of each coordinate [m]; None if not stated.
        left_out: Number of rows that the file marks as not valid.
    """

    time_s: FloatArray
    point_m: FloatArray
    sigma_m: FloatArray | None = None
    left_out: int = 0

    def __post_init__(self) -> None:
        freeze(self, DataQualityError, (None,), "time_s")
        freeze(self, DataQualityError, (len(self.time_s), 3), "point_m")
        freeze(self, DataQualityError, (len(self.time_s),), "sigma_m")

    @property
    def rate_hz(self) -> float:
        """Typical sampling rate, from the median time between rows [Hz]."""
        return float(1.0 / np.median(np.diff(self.time_s)))


def read_tracked_point(path: Path) -> TrackedPoint:
    """Return the positions in a tracker file.

    The file is a text table with the columns `time_s` and `x_m`, `y_m`, `z_m` (or `x_mm`, `y_mm`,
    `z_mm`), and optionally `sigma_m` (or `sigma_mm`) and `valid` (1 or 0). Any sampling rate and
    gaps are permitted. Other columns are ignored.

    Raises:
        ConfigError: The file cannot be read, a column is missing, a row is not a number or out of
            range, or the time stamps do not increase; the message names the line.
    """
    columns = read_named_columns(path)
    valid = read_valid(columns)
    columns = columns.keep(valid)
    return TrackedPoint(
        read_times(columns),
        read_points(columns),
        read_sigma(columns),
        int(len(valid) - valid.sum()),
    )


def read_times(columns: NamedColumns) -> FloatArray:
    """Return the time stamps of a table, (rows,) [s].

    Raises:
        ConfigError: There are too few rows, or the time stamps do not increase.
    """
    if len(columns.rows) < FEWEST_ROWS:
        raise ConfigError(
            f"{columns.path}: has {len(columns.rows)} valid rows, but at least {FEWEST_ROWS} are"
            " needed: record the whole motion",
            code=ROW,
        )
    name, _ = columns.choose({"time_s": 1.0}, "the time")
    time_s = columns.numbers(name)
    wrong = np.flatnonzero(np.diff(time_s) <= 0.0) + 1
    if wrong.size:
        raise ConfigError(
            f"{columns.path}:{columns.rows[wrong[0]]}: the time stamp {time_s[wrong[0]]:.9g} s is"
            f" not later than the one before, {time_s[wrong[0] - 1]:.9g} s: sort the rows and"
            " remove repeated ones",
            code=ROW,
        )
    return time_s


def read_points(columns: NamedColumns) -> FloatArray:
    """Return the points of a table, (rows, 3) [m].

    Raises:
        ConfigError: A coordinate has no column or two, the units differ, or a point is empty or too
            far away.
    """
    chosen = [
        columns.choose({f"{axis}_{unit}": size for unit, size in LENGTHS.items()}, f"{axis}")
        for axis in "xyz"
    ]
    if len({factor for _, factor in chosen}) > 1:
        raise ConfigError(
            f"{columns.path}:{columns.header_row}: the coordinates"
            f" {', '.join(name for name, _ in chosen)} have different units: use one unit",
            code="RID-TRACKER-COLUMNS",
        )
    points = np.column_stack(
        [columns.numbers(name, may_be_empty=True) * factor for name, factor in chosen]
    )
    wrong = ~(np.abs(points) <= FARTHEST_M)
    if wrong.any():
        row, axis = np.argwhere(wrong)[0]
        value = points[row, axis]
        words = "is empty" if np.isnan(value) else f"is {value:.6g} m, beyond {FARTHEST_M:g} m"
        raise ConfigError(
            f"{columns.path}:{columns.rows[row]}: {chosen[axis][0]} {words}: correct the row, or"
            " mark it by 0 in a column `valid`",
            code=ROW,
        )
    return points


def read_sigma(columns: NamedColumns) -> FloatArray | None:
    """Return the standard deviations of a table's points, (rows,) [m]; None without such a column.

    Raises:
        ConfigError: A standard deviation is empty, not positive, or larger than `LARGEST_SIGMA_M`.
    """
    names = {f"sigma_{unit}": size for unit, size in LENGTHS.items()}
    if not set(names) & set(columns.names):
        return None
    name, factor = columns.choose(names, "the standard deviation")
    sigma = columns.numbers(name, may_be_empty=True) * factor
    wrong = np.flatnonzero(~((sigma > 0.0) & (sigma <= LARGEST_SIGMA_M)))
    if wrong.size:
        raise ConfigError(
            f"{columns.path}:{columns.rows[wrong[0]]}: {name} gives {sigma[wrong[0]]:.6g} m: it"
            f" must be positive and at most {LARGEST_SIGMA_M:g} m",
            code=ROW,
        )
    return np.asarray(sigma)


def read_valid(columns: NamedColumns) -> BoolArray:
    """Return True for each row that the column `valid` does not mark by 0.

    Raises:
        ConfigError: A value is neither 0 nor 1.
    """
    if "valid" not in columns.names:
        return np.ones(len(columns.rows), dtype=np.bool_)
    marks = columns.numbers("valid")
    wrong = np.flatnonzero((marks != 0.0) & (marks != 1.0))
    if wrong.size:
        raise ConfigError(
            f"{columns.path}:{columns.rows[wrong[0]]}: valid is {marks[wrong[0]]:g}: write 1 or 0",
            code=ROW,
        )
    return np.asarray(marks == 1.0)
