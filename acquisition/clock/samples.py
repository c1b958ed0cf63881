"""`Samples`: signals from which a clock is judged."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Final

import numpy as np

from config.arrays import BoolArray, FloatArray
from config.column_file import each_column, selected_rows

STANDSTILL_SPEED: Final = 0.02
"""Lowest speed at which a joint is used to judge a clock [rad/s or m/s]."""
WIDE_S: Final = 0.1
"""Time over which the effect of jitter and rounding on a displacement is negligible [s]."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Rows of a recording whose clock is judged.

    Attributes:
        time_s: Shape (rows,). Time stamps, increasing [s].
        position, velocity, torque: Shape (rows, joints). Position [rad or m], velocity [rad/s or
            m/s], torque [N m or N]. The velocity is NaN for a joint without a recorded velocity.
    """

    time_s: FloatArray
    position: FloatArray
    velocity: FloatArray
    torque: FloatArray

    def __len__(self) -> int:
        return len(self.time_s)

    def part(self, rows: slice | BoolArray) -> Samples:
        """Return the selected rows; without a copy if these are all rows."""
        columns = [getattr(self, field.name) for field in fields(self)]
        if isinstance(rows, slice):
            return Samples(*(values[rows] for values in columns))
        return self if rows.all() else Samples(*(selected_rows(each, rows) for each in columns))

    @cached_property
    def period_s(self) -> float:
        """Median step of the stamps [s]."""
        return float(np.median(np.diff(self.time_s)))

    def moving(self) -> tuple[int, ...]:
        """Return the indices of joints with a velocity that are faster than `STANDSTILL_SPEED`."""
        span_s = float(self.time_s[-1] - self.time_s[0])
        way = np.array([np.abs(np.diff(q)).sum() for q in each_column(self.position)])
        has_velocity = [np.isfinite(v).all() for v in each_column(self.velocity)]
        return tuple(np.flatnonzero(has_velocity & (way > STANDSTILL_SPEED * span_s)).tolist())


def smallest_step(values: FloatArray) -> float:
    """Return the smallest difference between values of a column, ignoring rounding; 0 if none."""
    levels = np.unique(values)
    steps = np.diff(levels)
    floor = 1e-12 * max(abs(float(levels[0])), abs(float(levels[-1])), 1e-3)
    steps = steps[steps > floor]
    return float(steps.min()) if len(steps) else 0.0
