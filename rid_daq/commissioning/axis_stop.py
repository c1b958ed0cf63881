"""`suspected_units`: keys of the cell file and robot file that a stopped axis test makes doubtful.

An axis test moves one joint slowly, by a small distance. With wrong units, the drive can move it
faster or further. The motion then stops at a limit that the commanded motion does not reach, or by
a fault of the drive.
"""

from __future__ import annotations

from typing import Final

from acquisition.supervision.stop_reason import StopCode, StopReason
from config.cell.cell import CellConfig

OF_WRONG_UNITS: Final = frozenset(
    {
        StopCode.IMPLAUSIBLE_POSITION,
        StopCode.EMERGENCY,
        StopCode.DRIVE_FAULT,
        StopCode.FOLLOWING_ERROR,
        StopCode.POSITION_LIMIT,
        StopCode.VELOCITY_LIMIT,
        StopCode.TORQUE_LIMIT,
    }
)
"""Stops that wrong units of a drive can cause."""

_VELOCITIES: Final = "velocity_unit, velocity_units, encoder_increments"
_POSITIONS: Final = "encoder_increments"
_TORQUES: Final = "torque, rated_torque_nm, rated_current_a, torque_constant_nm_per_a"


def suspected_units(stop: StopReason | None, joint: str, cell: CellConfig) -> str:
    """Return a sentence with the keys to check after a stop; empty if units cannot be the cause.

    Args:
        stop: Reason of the stop; None if the motion was not stopped.
        joint: The joint that was tested.
        cell: The cell.
    """
    if stop is None or stop.code not in OF_WRONG_UNITS:
        return ""
    axis = next(each for each in cell.axes if each.joint == joint)
    keys = _POSITIONS if cell.servo_of(axis).by_position else _VELOCITIES
    sentence = (
        f"The test moves {joint} only slowly. If {joint} moved too fast or too far, check its servo"
        f" first, in the cell file: {keys}; then gear_ratio in the robot file."
    )
    if stop.code is not StopCode.TORQUE_LIMIT:
        return sentence
    return f"{sentence} If nothing moved, check the servo of {stop.joint or joint}: {_TORQUES}."
