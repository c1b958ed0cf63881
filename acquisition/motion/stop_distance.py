"""Stopping distances on a planned motion, compared with the position limits.

At every row of the motion a stop can begin: a stop that is ordered, or the drives' own stop after
this computer has failed. From the row's position each motor continues at the row's velocity until
its drive begins to stop, and then decelerates as in a quick stop. Its position at rest must still
be within the limits, otherwise a stop moves the joint against its mechanical end.
"""

from __future__ import annotations

import numpy as np

from acquisition.motion.limits import position_bounds
from acquisition.motion.samples import MotionSamples
from config.arrays import FloatArray
from config.cell.cell import CellConfig
from config.errors import PreflightError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import convert_to_joints, convert_to_motors
from drivers.servo.stop_ramp import quick_stop_decelerations
from dynamics.geometry.clearances import Clearances

ORDERED_STOP_CYCLES = 2
"""Cycles from the row at which a stop is ordered until the drives begin to stop."""
ROWS_AT_ONCE = 200


def rest_positions(
    samples: MotionSamples, cell: CellConfig, robot: RobotDescription, delay_s: float
) -> FloatArray:
    """Return the joints' positions at rest if the motion is stopped at each of its rows.

    In a robot with a coupled wrist, each motor stops by its own ramp.

    Args:
        samples: The motion; of a periodic motion, two periods are used.
        cell, robot: Cell with the decelerations of a quick stop, and its robot.
        delay_s: Time until the drives begin to stop [s].

    Returns:
        Shape (rows, joints). Positions at rest [rad or m].
    """
    brief = samples.whole(most_periods=2)
    motors = convert_to_motors(robot, brief.velocity)
    deceleration = np.array(quick_stop_decelerations(cell, robot))
    travel = motors * delay_s + 0.5 * motors * np.abs(motors) / deceleration
    return np.asarray(brief.position + convert_to_joints(robot, travel))


def verify_stops(
    samples: MotionSamples, cell: CellConfig, robot: RobotDescription, clearances: Clearances
) -> None:
    """Make sure that a stop at any row of the motion ends within limits, without a collision.

    A joint may be beyond its position limit by the margin that the cyclic task also allows.

    Raises:
        PreflightError: A stop would end beyond a limit, or with two bodies in contact; the text
            names joint, time, distance and limit.
    """
    end = rest_positions(samples, cell, robot, ORDERED_STOP_CYCLES * cell.cycle_time_s)
    worst = _farthest_beyond(end, cell, robot)
    if worst is not None:
        row, joint, text = worst
        raise PreflightError(
            f"a stop {row * samples.sample_period_s:.2f} s after the motion's start would end with"
            f" {text}; nothing was moved. Plan a motion that is slower near this limit, or raise"
            f" quick_stop_deceleration_rad_s2 of {joint}, if motor and gear allow it",
            code="RID-MOTION-STOP",
        )
    if len(clearances) == 0:
        return
    for first in range(0, len(end), ROWS_AT_ONCE):
        distance = clearances.nearest(end[first : first + ROWS_AT_ONCE])
        if (distance < 0.0).any():
            row, pair = map(int, np.unravel_index(int(np.argmin(distance)), distance.shape))
            raise PreflightError(
                f"a stop {(first + row) * samples.sample_period_s:.2f} s after the motion's start"
                f" would end with {clearances.names[pair]} in contact; nothing was moved."
                " Plan a motion that is slower near this place",
                code="RID-MOTION-STOP",
            )


def late_stop_note(samples: MotionSamples, cell: CellConfig, robot: RobotDescription) -> str:
    """Return a remark if a stop after a failure of this computer could end beyond a limit.

    The drives detect the failure only after `master_heartbeat_timeout_ms`. The cell's own emergency
    stop and the mechanical ends remain, therefore the motion is not refused.
    """
    delay_s = 1e-3 * cell.drive_safety.master_heartbeat_timeout_ms
    worst = _farthest_beyond(rest_positions(samples, cell, robot, delay_s), cell, robot)
    if worst is None:
        return ""
    row, _, text = worst
    return (
        f"if this computer fails {row * samples.sample_period_s:.2f} s after the motion's start,"
        f" the drives stop by themselves {1e3 * delay_s:.0f} ms later, with {text}"
    )


def _farthest_beyond(
    end: FloatArray, cell: CellConfig, robot: RobotDescription
) -> tuple[int, str, str] | None:
    """Return row, joint and description of the stop that ends farthest beyond a limit."""
    low, high = map(np.array, position_bounds(cell, robot))
    beyond = np.maximum(end - high, low - end)
    row, number = map(int, np.unravel_index(int(np.argmax(beyond)), beyond.shape))
    if beyond[row, number] <= 0.0:
        return None
    joint = robot.joints[number]
    value = float(end[row, number])
    limit = joint.limits.position_max if value > high[number] else joint.limits.position_min
    text = (
        f"joint {joint.name} at {value:.4g} {joint.unit},"
        f" {abs(value - limit):.3g} {joint.unit} beyond its limit of {limit:.4g} {joint.unit}"
    )
    return row, joint.name, text
