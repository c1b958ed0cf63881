"""`StopCurve`: what a joint did in the last second before a motion was stopped for its sake."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from acquisition.supervision.stop_reason import StopCode
from config.arrays import FloatArray
from rid_daq.report.sections.section import Numbers, Section, curve_rows, rounded, units

if TYPE_CHECKING:
    from acquisition.recording.recording import Recording
    from acquisition.supervision.stop_reason import StopReason
    from config.cell.cell import CellConfig
    from config.robot.robot import RobotDescription

SHOWN_S: Final = 1.0
SAME: Final = 1e-3

_OF_CODE: Final = {
    StopCode.FOLLOWING_ERROR: "following error",
    StopCode.STUCK_ENCODER: "following error",
    StopCode.POSITION_LIMIT: "position",
    StopCode.IMPLAUSIBLE_POSITION: "position",
    StopCode.VELOCITY_LIMIT: "velocity",
    StopCode.SET_POINT: "velocity of the set-point",
}
_MEASURED: Final = (
    *(StopCode.FOLLOWING_ERROR, StopCode.POSITION_LIMIT),
    *(StopCode.VELOCITY_LIMIT, StopCode.TORQUE_LIMIT),
)


class _Quantity(NamedTuple):
    """One quantity of a joint, row by row, with what was allowed."""

    unit: str
    value: FloatArray
    low: FloatArray
    high: FloatArray


class StopCurve(Section):
    """What was judged of the joint that a motion was stopped for, up to the stop.

    Attributes:
        joint, quantity, unit: Which joint, what of it, and its unit. Where a drive said no more
            than that it failed, it is the torque.
        time_s: Before the stop, which is 0 [s].
        value, low, high: Values, and the least and greatest that were allowed, in `unit`.
    """

    joint: str
    quantity: str
    unit: str
    time_s: Numbers
    value: Numbers
    low: Numbers
    high: Numbers

    @classmethod
    def of(
        cls, recording: Recording, reason: StopReason, cell: CellConfig, robot: RobotDescription
    ) -> StopCurve | None:
        """Return the curve of a stop; None where it is about no joint, or nothing was recorded.

        Args:
            recording: The end of the recording, at least.
            reason: Why the motion was stopped.
            cell: What it was allowed.
            robot: Names, limits and units of the joints.
        """
        if reason.joint not in robot.joint_names or recording.target_position is None:
            return None
        joint = robot.joint_names.index(reason.joint)
        name = _OF_CODE.get(reason.code, "torque")
        drawn = _quantity(name, recording, joint, cell, robot)
        last = _stop_row(recording, drawn.value, reason)
        since = recording.time_s - recording.time_s[last]
        kept = np.flatnonzero((since >= -SHOWN_S) & (since <= 0.0) & np.isfinite(drawn.value))
        if len(kept) < 2:
            return None
        kept = kept[::-1][curve_rows(len(kept))][::-1]  # the stop itself is always kept
        return cls(
            joint=reason.joint,
            quantity=name,
            unit=drawn.unit,
            time_s=rounded(since[kept]),
            value=rounded(drawn.value[kept]),
            low=rounded(drawn.low[kept]),
            high=rounded(drawn.high[kept]),
        )

    @property
    def caption(self) -> str:
        """What is drawn, in a sentence."""
        return (
            f"{self.joint}: {self.quantity} in the last second before the stop, and what was"
            f" allowed; at the stop {self.value[-1]:.4g} {self.unit}."
        )


def _quantity(
    name: str, recording: Recording, joint: int, cell: CellConfig, robot: RobotDescription
) -> _Quantity:
    """Return a quantity of a joint over all rows, with what the supervision allows."""
    from acquisition.motion.limits import position_bounds

    limits, rules = robot.joints[joint].limits, cell.supervision
    unit, torque_unit = units(robot.joints[joint])
    assert recording.target_position is not None
    target, position = recording.target_position[:, joint], recording.position[:, joint]
    margin = 1.0 + rules.limit_margin_fraction
    even = np.ones(len(position))
    if name == "following error":
        per_speed = rules.following_error_per_velocity_s
        speed = np.abs(_velocity(recording.time_s, target))
        allowed = rules.following_error_min_rad + per_speed * np.nan_to_num(speed)
        return _Quantity(unit, target - position, -allowed, allowed)
    if name == "position":
        low, high = position_bounds(cell, robot)
        return _Quantity(unit, position, low[joint] * even, high[joint] * even)
    if name == "torque":
        reach = limits.torque * margin * even
        return _Quantity(torque_unit, recording.torque_nm[:, joint], -reach, reach)
    reach = limits.velocity * margin * even
    moved = target if name.endswith("set-point") else position
    return _Quantity(f"{unit}/s", _velocity(recording.time_s, moved), -reach, reach)


def _velocity(time_s: FloatArray, position: FloatArray) -> FloatArray:
    """Return the velocity since the row before; not a number in the first row."""
    moved = np.full(len(position), np.nan)
    moved[1:] = np.diff(position) / np.diff(time_s)
    return moved


def _stop_row(recording: Recording, value: FloatArray, reason: StopReason) -> int:
    """Return the row in which the motion was stopped.

    It is the one that holds the value that was told; where none was told of this quantity, the last
    one before the robot was held where it came to rest.
    """
    if reason.code in _MEASURED and reason.value is not None:
        off = np.abs(value - reason.value)
        off = np.where(np.isfinite(off), off, np.inf)
        if off.min() <= SAME * abs(reason.value):
            return int(len(off) - 1 - np.argmin(off[::-1]))
    from acquisition.motion.samples import Phase

    moving = np.flatnonzero(recording.phase != Phase.HOLD)
    return int(moving[-1]) if len(moving) else len(value) - 1
