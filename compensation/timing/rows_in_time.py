"""A timed path as rows of a motion, one per cycle.

The acceleration of the speed profile has jumps. Therefore the path length, as a function of time,
is averaged exactly over a moving window. Accelerations are then continuous, and so are torques,
except for jumps of friction at reversals. The rows stay on the path, and reach each place half a
window later.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from acquisition.motion.samples import JointTrajectory
from compensation.timing.joint_curve import JointCurve
from compensation.timing.profile import SpeedOverPath
from config.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class RowsInTime:
    """Rows of a motion, with the path length of each row.

    Attributes:
        path: Positions, velocities, accelerations.
        length, speed, change: Shape (rows,). Path length and its derivatives, per second and per
            second squared.
        begin, end: Shape (rows,). First and last interval of the path's grid that contribute to a
            row.
    """

    path: JointTrajectory
    length: FloatArray
    speed: FloatArray
    change: FloatArray
    begin: IntArray
    end: IntArray


def rows_in_time(
    curve: JointCurve,
    profile: SpeedOverPath,
    cycle_s: float,
    *,
    window_s: float,
    slower: float,
) -> RowsInTime:
    """Return a timed path, one row per cycle; the total time is rounded up to whole cycles.

    Args:
        curve, profile: The path and its speed.
        cycle_s: Time between rows [s].
        window_s: Length of the averaging window [s].
        slower: Smallest factor by which the time is extended.
    """
    total_s = float(profile.time_s[-1])
    cycles = max(2, math.ceil((slower * total_s + window_s) / cycle_s - 1e-9))
    stretch = (cycles * cycle_s - window_s) / total_s
    at_s: FloatArray = np.arange(cycles + 1, dtype=np.float64) * cycle_s - 0.5 * window_s
    before, after = at_s - 0.5 * window_s, at_s + 0.5 * window_s
    first, last = _at(profile, before / stretch), _at(profile, after / stretch)
    speed = (last.length - first.length) / window_s
    change = (last.speed - first.speed) / (stretch * window_s)
    speed[[0, -1]] = change[[0, -1]] = 0.0
    length = np.clip(stretch * (last.area - first.area) / window_s, *curve.ends)
    length[-1] = curve.ends[1]
    position, slope, bend = curve.at(length)
    rate, more = speed[:, np.newaxis], change[:, np.newaxis]
    path = JointTrajectory(position, slope * rate, slope * more + bend * rate**2)
    return RowsInTime(path, length, speed, change, first.interval, last.interval)


@dataclass(frozen=True, eq=False)
class _At:
    interval: IntArray
    area: FloatArray
    length: FloatArray
    speed: FloatArray


def _at(profile: SpeedOverPath, time_s: FloatArray) -> _At:
    """Evaluate a profile at the given times; before and after the profile, the path is at rest."""
    when, root = profile.time_s, np.sqrt(profile.x)
    begin, speed, u = profile.length[:-1], root[:-1], profile.u
    steps = np.diff(when)
    area = begin * steps + speed * steps**2 / 2.0 + u * steps**3 / 6.0
    areas = np.concatenate([[0.0], np.cumsum(area)])
    inside = np.clip(time_s, when[0], when[-1])
    k = np.clip(np.searchsorted(when, inside, "right") - 1, 0, len(steps) - 1)
    t = inside - when[k]
    beyond = time_s - inside
    length = begin[k] + t * (speed[k] + 0.5 * u[k] * t)
    length = np.where(time_s >= when[-1], profile.length[-1], length)
    own = areas[k] + t * (begin[k] + t * (speed[k] / 2.0 + t * u[k] / 6.0)) + beyond * length
    moving = np.where(beyond == 0.0, np.maximum(speed[k] + u[k] * t, 0.0), 0.0)
    moving = np.where(time_s >= when[-1], root[-1], moving)
    return _At(k.astype(np.int64), own, length, moving)
