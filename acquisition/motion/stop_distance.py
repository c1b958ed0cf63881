"""Stopping distances of a motion, compared with the position limits and the bodies.

At every row of the motion a stop can begin: a stop that is ordered, or the drives' own stop after
this computer has failed. From the row's position each motor continues at the row's velocity until
its drive begins to stop, and then decelerates as in a quick stop. Its position at rest must still
be within the limits, otherwise a stop moves the joint against its mechanical end.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from acquisition.motion.collision import rows_before_closer
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


def stop_travel(
    velocity: FloatArray, cell: CellConfig, robot: RobotDescription, delay_s: float
) -> FloatArray:
    """Return the distance that each joint still moves after a stop was ordered.

    In a robot with a coupled wrist, each motor stops by its own ramp.

    Args:
        velocity: Shape (rows, joints). Velocities at which the stop is ordered.
        cell, robot: Cell with the decelerations of a quick stop, and its robot.
        delay_s: Time until the drives begin to stop [s].

    Returns:
        Shape (rows, joints). Signed distances [rad or m].
    """
    motors = convert_to_motors(robot, velocity)
    deceleration = np.array(quick_stop_decelerations(cell, robot))
    travel = motors * delay_s + 0.5 * motors * np.abs(motors) / deceleration
    return convert_to_joints(robot, travel)


def rest_positions(
    samples: MotionSamples, cell: CellConfig, robot: RobotDescription, delay_s: float
) -> FloatArray:
    """Return the joints' positions at rest if the motion is stopped at each of its rows.

    Args:
        samples: The motion; of a periodic motion, two periods are used.
        cell, robot: Cell with the decelerations of a quick stop, and its robot.
        delay_s: Time until the drives begin to stop [s].

    Returns:
        Shape (rows, joints). Positions at rest [rad or m].
    """
    brief = samples.whole(most_periods=2)
    travel = stop_travel(brief.velocity, cell, robot, delay_s)
    return np.asarray(brief.position + travel)


def verify_stops(
    samples: MotionSamples,
    cell: CellConfig,
    robot: RobotDescription,
    clearances: Clearances,
    what: str = "the motion",
    meanwhile: Callable[[], None] = lambda: None,
) -> None:
    """Make sure that a stop at any row of a motion ends within limits, without a collision.

    Args:
        samples: The motion.
        cell, robot: Cell with the decelerations of a quick stop, and its robot.
        clearances: Pairs of bodies.
        what: Name of the motion in the message.
        meanwhile: Function that is called before each 20 rows of the collision check.

    Raises:
        PreflightError: A stop would end beyond a limit, or with two bodies in contact; the text
            names joint, time, distance and limit.
    """
    end = rest_positions(samples, cell, robot, ORDERED_STOP_CYCLES * cell.cycle_time_s)
    found = bad_rest(end, cell, robot, clearances, meanwhile)
    if found is not None:
        row, text = found
        raise PreflightError(
            f"a stop {row * samples.sample_period_s:.2f} s after the start of {what} would end with"
            f" {text}. Nothing was moved",
            code="RID-MOTION-STOP",
        )


def bad_rest(
    end: FloatArray,
    cell: CellConfig,
    robot: RobotDescription,
    clearances: Clearances,
    meanwhile: Callable[[], None] = lambda: None,
) -> tuple[int, str] | None:
    """Return the row of a pose at rest that is not permitted, with its reason; None without one.

    A joint may be beyond its position limit by the margin that the cyclic task also allows.

    Args:
        end: Shape (rows, joints). Poses in which stops end [rad or m].
        cell, robot: The cell and its robot.
        clearances: Pairs of bodies; they must not be in contact.
        meanwhile: Function that is called before each 20 rows of the collision check.
    """
    if len(end) == 0:
        return None
    worst = _farthest_beyond(end, cell, robot)
    if worst is not None:
        row, joint, text = worst
        return row, (
            f"{text}. Use a motion that is slower near this limit, or raise"
            f" quick_stop_deceleration_rad_s2 of {joint}, if motor and gear allow it"
        )
    row = rows_before_closer(clearances, end, 0.0, meanwhile)
    if row == len(end):
        return None
    pair = int(np.argmin(clearances.nearest(end[row : row + 1])))
    return row, (
        f"{clearances.names[pair]} in contact. Use a motion that is slower near this place"
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
    """Return row, joint and text of the stop ending farthest beyond a limit; None without one."""
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
