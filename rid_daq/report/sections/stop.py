"""`StopCurve`: the last second before a stop, for the joint that caused the stop."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from acquisition.supervision.stop_reason import StopCode
from config.arrays import FloatArray
from rid_daq.report.sections.section import (
    Numbers,
    Section,
    round_values,
    thinning_slice,
)

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
    """Values of one quantity of a joint, row by row, with the allowed range."""

    unit: str
    value: FloatArray
    low: FloatArray
    high: FloatArray


class StopCurve(Section):
    """Curve of the quantity that stopped a motion, up to the stop.

    Attributes:
        joint: Name of the joint.
        quantity: Name of the quantity. It is the torque if the stop reason concerns a joint but
            none of the other quantities, such as a fault of the drive.
        unit: Unit of the quantity.
        time_s: Time relative to the stop, which is at 0 [s].
        value: Values of the quantity, in `unit`.
        low: Lowest allowed values, in `unit`.
        high: Highest allowed values, in `unit`.
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
        """Return the curve of a stop; None if the stop concerns no joint, or too few rows show it.

        A curve needs set-points, and at least two rows in the last second before the stop.

        Args:
            recording: The recording, or at least its end.
            reason: The stop reason.
            cell: The cell with its supervision limits.
            robot: Robot with names, limits and units of the joints.
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
        kept = kept[::-1][thinning_slice(len(kept))][::-1]  # always keep the row of the stop
        return cls(
            joint=reason.joint,
            quantity=name,
            unit=drawn.unit,
            time_s=round_values(since[kept]),
            value=round_values(drawn.value[kept]),
            low=round_values(drawn.low[kept]),
            high=round_values(drawn.high[kept]),
        )

    @property
    def caption(self) -> str:
        """Caption of the curve, in a sentence."""
        return (
            f"{self.joint}: {self.quantity} in the last second before the stop, with its allowed"
            f" range; at the stop {self.value[-1]:.4g} {self.unit}."
        )


def _quantity(
    name: str, recording: Recording, joint: int, cell: CellConfig, robot: RobotDescription
) -> _Quantity:
    """Return a quantity of a joint in all rows, with the range that the supervisor allows."""
    from acquisition.motion.limits import position_bounds

    limits, rules = robot.joints[joint].limits, cell.supervision
    unit, torque_unit = robot.joints[joint].unit, robot.joints[joint].torque_unit
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
    """Return the velocity between each row and the row before; NaN in the first row."""
    moved = np.full(len(position), np.nan)
    moved[1:] = np.diff(position) / np.diff(time_s)
    return moved


def _stop_row(recording: Recording, value: FloatArray, reason: StopReason) -> int:
    """Return the row in which the motion was stopped.

    This is the last row with the value that the stop reason contains. If the stop reason contains
    no value of this quantity, it is the last row before the standstill after the stop.
    """
    if reason.code in _MEASURED and reason.value is not None:
        off = np.abs(value - reason.value)
        off = np.where(np.isfinite(off), off, np.inf)
        if off.min() <= SAME * abs(reason.value):
            return int(len(off) - 1 - np.argmin(off[::-1]))
    from acquisition.motion.samples import Phase

    moving = np.flatnonzero(recording.phase != Phase.HOLD)
    return int(moving[-1]) if len(moving) else len(value) - 1
