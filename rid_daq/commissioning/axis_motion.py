"""`AxisMotion`: motion of one axis in its axis test, computed from the recording."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.hold_to_run.line import HoldLine
from config.arrays import FloatArray
from config.robot.robot import RobotDescription

REST_ROWS: Final = 10
LARGEST_STEP: Final = 100.0
"""A change of the counts that is this many times the median change is a wrap of the counter."""


@dataclass(frozen=True)
class AxisMotion:
    """Small motion of one axis in its axis test.

    Attributes:
        unit: "°" or "mm".
        commanded: Displacement of the set-point, in the unit.
        measured: Displacement that the drive has measured, in the unit.
        counts: Change of the drive's position in increments.
        command_ratio: Integral of the commanded velocity, divided by the measured displacement;
            near 1 if velocity unit and encoder resolution in the files are correct, infinite if the
            drive measured no motion.
        increments_per_rev: Encoder increments per motor revolution, from the drive's counts and the
            robot file's gear ratio; None for a robot with a coupled wrist, for a linear axis, and
            if the drive measured no motion.
    """

    joint: str
    unit: str
    commanded: float
    measured: float
    counts: int
    command_ratio: float
    increments_per_rev: float | None

    def signed_text(self, amount: float) -> str:
        """Return a displacement with its sign and unit."""
        return self._with_unit(f"{amount:+.2f}")

    def size_text(self, amount: float) -> str:
        """Return the absolute value of a displacement with its unit."""
        return self._with_unit(f"{abs(amount):.3g}")

    def _with_unit(self, amount: str) -> str:
        return f"{amount}°" if self.unit == "°" else f"{amount} {self.unit}"

    @classmethod
    def of(cls, rows: NDArray[Any], robot: RobotDescription, number: int) -> AxisMotion:
        """Return the motion of the axis `number` in the rows of a recording."""
        joint = robot.joints[number]
        per = math.degrees(1.0) if joint.type == "revolute" else 1e3
        rows = rows[rows["valid"][:, number] == 1]
        moving = np.flatnonzero(rows["target_velocity"][:, number])
        first, last = (0, 0) if not len(moving) else (int(moving[0]), int(moving[-1]) + 1)
        target, position = rows["target_position"][:, number], rows["position"][:, number]
        counts = _unwrapped_counts(rows["position_counts"][:, number].astype(float), position)
        before, after = slice(max(0, first - REST_ROWS), first + 1), slice(-REST_ROWS, None)
        moved = float(position[after].mean() - position[before].mean())
        increments = float(counts[after].mean() - counts[before].mean())
        step_s = np.diff(rows["time_s"], append=rows["time_s"][-1:])
        driven = float((rows["velocity_command"][:, number] * step_s)[first:].sum())
        revs = moved * joint.gear_ratio / (2.0 * math.pi)
        return cls(
            joint=joint.name,
            unit="°" if joint.type == "revolute" else "mm",
            commanded=per * float(target[last] - target[max(0, first - 1)]),
            measured=per * moved,
            counts=round(increments),
            command_ratio=driven / moved if moved else math.inf,
            increments_per_rev=abs(increments / revs)
            if revs and robot.coupling is None and joint.type == "revolute"
            else None,
        )


def travelled_fraction(line: HoldLine, rows: NDArray[Any], number: int) -> float:
    """Return the fraction of a path that the set-points of an axis have travelled."""
    target = rows["target_position"][:, number]
    return float((target[-1] - target[0]) / (line.goal[number] - line.start[number]))


def _unwrapped_counts(counts: FloatArray, position: FloatArray) -> FloatArray:
    """Return the counts without the wraps of the drive's counter (at 32 bits, or by 607Bh).

    Args:
        counts: Shape (rows,). Increments as received.
        position: Shape (rows,). Position of the joint, without wraps [rad or m].
    """
    steps, moved = np.diff(counts), np.diff(position)
    changes = np.abs(steps[steps != 0.0])
    usual = np.abs(steps) <= LARGEST_STEP * np.median(changes) if len(changes) else steps == 0.0
    size = float(moved[usual] @ moved[usual])
    scale = float(steps[usual] @ moved[usual]) / size if size else 0.0
    steps[~usual] = np.rint(scale * moved[~usual])
    return np.concatenate([counts[:1], counts[:1] + np.cumsum(steps)])
