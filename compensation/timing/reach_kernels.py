"""Scan over path position and squared speed: controllable sets backwards, then a pass forwards.

x is the squared speed along the path, u the acceleration. Each limit is a row A u + B x + C + f(x)
between two bounds, in which f is the friction at the speed of x. u is constant between two points
of the grid, and the rows of both points must hold. There are two passes, as in TOPP-RA (Pham and
Pham 2018):
1. The pass backwards finds the largest x at each point from which the end can be reached.
2. The pass forwards drives as fast as these values of x allow.

For a given x, each row bounds u, so the allowed values of u form an interval. If the interval is
empty, x must decrease. Newton's method then approximates the two conflicting rows by straight
lines, with the slope of friction, and goes to their intersection. When the iteration has converged,
x is consistent with its own friction, so friction is exact. A row without u (a zero-inertia point)
bounds x directly, in the same iteration.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np

from config.arrays import BoolArray, FloatArray, IntArray
from dynamics.kernels.friction import BY_SPEED, friction_function
from dynamics.kernels.simd import kernel
from dynamics.model.one_sample import BASE_WRENCH as WRENCH
from dynamics.model.one_sample import (
    FREE_TORQUE,
    FUNCTION,
    JOINT,
    LOAD_TORQUE,
    SPEED,
    VALUE,
    ModelArrays,
    sample_torque,
)

FrictionArrays: TypeAlias = tuple[IntArray, FloatArray, float, FloatArray, BoolArray]

STEPS: Final = 60
TINY: Final = 1e-14  # smaller coefficients of u count as 0, because they are rounding errors
CLOSE: Final = 1e-9
LOOSE: Final = 1e-6
SLOPE_STEP: Final = 1e-6
# rad/s: below this speed, friction has its sign but no part that depends on speed
FROM_REST: Final = 1e-9

# Words of an interval of u: its ends, and their derivatives with respect to x.
LEAST: Final = 0
MOST: Final = 1
LEAST_SLOPE: Final = 2
MOST_SLOPE: Final = 3
ALONE: Final = 4  # decrease of x that a row without u requires; -1 if none is required


@kernel
def along_path(
    model: ModelArrays, q: FloatArray, slope: FloatArray, bend: FloatArray, out: FloatArray
) -> None:
    """Split torques and base wrench into a part with u, a part with x, and a part at rest.

    Load torques pass through the gears; free torques do not.

    Args:
        model: `SampleTorque.arrays`, without friction.
        q, slope, bend: Shape (points, n). Joint positions and their derivatives
            with respect to the path length.
        out: Shape (points, 2 n + 6, 3). Written: load torques, free torques and base wrench, by u,
            by x, and at rest.
    """
    n = q.shape[1]
    memory = model[6]
    rest, torque = np.zeros(n), np.empty(n)
    for i in range(len(q)):
        for part in (2, 0, 1):
            if part == 2:
                sample_torque(model, q[i], rest, rest, torque)
            elif part == 0:
                sample_torque(model, q[i], rest, slope[i], torque)
            else:
                sample_torque(model, q[i], slope[i], bend[i], torque)
            for j in range(n):
                out[i, j, part] = memory[n + LOAD_TORQUE, j]
                out[i, n + j, part] = memory[n + FREE_TORQUE, j]
            for c in range(6):
                out[i, 2 * n + c, part] = memory[n + WRENCH, c]
        for row in range(2 * n + 6):
            out[i, row, 0] -= out[i, row, 2]
            out[i, row, 1] -= out[i, row, 2]


@kernel
def torques_of(
    model: ModelArrays,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    torque: FloatArray,
    wrench: FloatArray,
) -> None:
    """Compute torques (samples, n) and base wrenches (samples, 6) of rows of a motion."""
    n = q.shape[1]
    for i in range(len(q)):
        sample_torque(model, q[i], v[i], a[i], torque[i])
        for c in range(6):
            wrench[i, c] = model[6][n + WRENCH, c]


@kernel
def friction_at(
    table: FloatArray,
    smoothing: float,
    speed: FloatArray,
    both: BoolArray,
    x: float,
    found: FloatArray,
) -> None:
    """Fill `found` (4, n): smallest and largest friction of each joint, and their slopes by x.

    `speed` (n,) is the actuators' speed at x = 1. Smallest and largest friction differ only if a
    joint reverses or rests nearby (`both`), because its friction can then have either sign.
    """
    root = math.sqrt(max(x, 0.0))
    for j in range(len(speed)):
        for word in range(4):
            found[word, j] = 0.0
    for k in range(len(table)):
        j, function = int(table[k, JOINT]), int(table[k, FUNCTION])
        size, scale = table[k, VALUE], table[k, SPEED]
        v = speed[j] * root
        if both[j] and abs(v) < FROM_REST:
            v = FROM_REST
        elif abs(v) < FROM_REST:
            v = FROM_REST if speed[j] > 0.0 else -FROM_REST
        here = size * friction_function(function, v, scale, smoothing, BY_SPEED)
        slope = 0.0
        if x > 0.0 and speed[j] != 0.0:
            faster = v * (1.0 + SLOPE_STEP)
            there = size * friction_function(function, faster, scale, smoothing, BY_SPEED)
            slope = (there - here) / (2.0 * SLOPE_STEP * x)
        other, other_slope = here, slope
        if both[j]:
            other = size * friction_function(function, -v, scale, smoothing, BY_SPEED)
            if x > 0.0 and speed[j] != 0.0:
                back = -v * (1.0 + SLOPE_STEP)
                there = size * friction_function(function, back, scale, smoothing, BY_SPEED)
                other_slope = (there - other) / (2.0 * SLOPE_STEP * x)
        if other < here:
            here, slope, other, other_slope = other, other_slope, here, slope
        found[0, j] += here
        found[1, j] += other
        found[2, j] += slope
        found[3, j] += other_slope


@kernel
def friction_at_rest(friction: FrictionArrays, out: FloatArray) -> None:
    """Fill `out` (points, 2, n): smallest and largest friction of a slow motion."""
    _, table, smoothing, speed, both = friction
    found = np.empty((4, speed.shape[1]))
    turns = np.empty(speed.shape[1], np.bool_)
    last = len(both) - 1
    for i in range(len(speed)):
        for j in range(len(turns)):
            turns[j] = both[min(i, last), j] or both[max(i - 1, 0), j]
        friction_at(table, smoothing, speed[i], turns, 0.0, found)
        for j in range(len(turns)):
            out[i, 0, j], out[i, 1, j] = found[0, j], found[1, j]


@kernel
def _narrow(room: FloatArray, by_u: float, rest: float, slope: float, bound: float) -> None:
    """Narrow the interval of u to the values with `by_u * u + rest <= bound`.

    `slope` is the derivative of `rest` with respect to x.
    """
    free = bound - rest
    if by_u > TINY:
        most = free / by_u
        if most < room[MOST]:
            room[MOST], room[MOST_SLOPE] = most, -slope / by_u
    elif by_u < -TINY:
        least = free / by_u
        if least > room[LEAST]:
            room[LEAST], room[LEAST_SLOPE] = least, -slope / by_u
    elif free < -CLOSE:
        # Decrease of x with which the row is satisfied. If no decrease suffices, it is infinite, so
        # that x becomes 0.
        fall = -free / slope if slope > 0.0 else math.inf
        room[ALONE] = max(room[ALONE], fall)


@kernel
def _feasible_interval(
    rows: FloatArray,
    bounds: FloatArray,
    joints: IntArray,
    friction: FloatArray,
    x: float,
    twice_step: float,
    there: float,
    room: FloatArray,
) -> None:
    """Narrow the interval of u by the rows at one end of a path interval.

    At the beginning of the path interval, `twice_step` is 0. At its end, x becomes x + twice_step
    u, and friction is a straight line in x through its value at x = `there`.
    """
    for r in range(len(rows)):
        by_u, by_x, rest = rows[r, 0], rows[r, 1], rows[r, 2]
        j = joints[r]
        low, high, low_slope, high_slope = 0.0, 0.0, 0.0, 0.0
        if j >= 0:
            low, high = bounds[r, 2] * friction[0, j], bounds[r, 2] * friction[1, j]
            low_slope, high_slope = bounds[r, 2] * friction[2, j], bounds[r, 2] * friction[3, j]
        if bounds[r, 1] < math.inf:
            slope = by_x + high_slope
            shift = 0.0 if twice_step == 0.0 else high_slope * (x - there)
            _narrow(room, by_u + twice_step * slope, by_x * x + rest + high + shift, slope,
                    bounds[r, 1])  # fmt: skip
        if bounds[r, 0] > -math.inf:
            slope = by_x + low_slope
            shift = 0.0 if twice_step == 0.0 else low_slope * (x - there)
            _narrow(room, -by_u - twice_step * slope, -by_x * x - rest - low - shift, -slope,
                    -bounds[r, 0])  # fmt: skip


@kernel
def _initial_interval(room: FloatArray, x: float, twice_step: float, most_there: float) -> None:
    """Start with all u for which x is from 0 to `most_there` at the other end of the interval."""
    room[LEAST], room[LEAST_SLOPE] = -x / twice_step, -1.0 / twice_step
    room[MOST], room[MOST_SLOPE] = (most_there - x) / twice_step, -1.0 / twice_step
    room[ALONE] = -1.0


@kernel
def _resume_speed(room: FloatArray, x: float) -> float:
    """Return the largest x at which the two limiting rows leave a u, by linear extrapolation."""
    if room[ALONE] > 0.0:
        return float(max(0.0, x - room[ALONE]))
    closing = room[LEAST_SLOPE] - room[MOST_SLOPE]
    if closing <= 0.0:
        return 0.5 * x
    return float(max(0.0, x - (room[LEAST] - room[MOST]) / closing))


@kernel
def _is_feasible(room: FloatArray) -> bool:
    size = abs(room[LEAST]) + abs(room[MOST])
    return bool(room[ALONE] < 0.0 and room[LEAST] - room[MOST] <= CLOSE * size)


@kernel
def limit_curve_kernel(
    rows: FloatArray,
    bounds: FloatArray,
    friction: FrictionArrays,
    most: FloatArray,
    out: FloatArray,
) -> None:
    """Fill `out` (points,) with the limit curve: the largest x at each point separately."""
    joints, table, smoothing, speed, both = friction
    here, room = np.empty((4, speed.shape[1])), np.empty(5)
    for i in range(len(rows)):
        x = most[i]
        for _ in range(STEPS):
            room[LEAST], room[MOST] = -math.inf, math.inf
            room[LEAST_SLOPE] = room[MOST_SLOPE] = 0.0
            room[ALONE] = -1.0
            friction_at(table, smoothing, speed[i], both[min(i, len(both) - 1)], x, here)
            _feasible_interval(rows[i], bounds[i], joints, here, x, 0.0, x, room)
            if _is_feasible(room):
                break
            x = _resume_speed(room, x)
        out[i] = x


@kernel
def backwards(
    rows: FloatArray,
    bounds: FloatArray,
    friction: FrictionArrays,
    length: FloatArray,
    most: FloatArray,
    end: float,
    out: FloatArray,
) -> None:
    """Fill `out` (points,) with the largest x from which the end is reachable.

    Args:
        rows: Shape (points, rows, 3). A, B and C.
        bounds: Shape (points, rows, 3). Lower and upper bound of a row, and factor of its joint's
            friction.
        friction: A tuple of five elements:
            1. joint of each row's friction, shape (rows,); -1 for a row without friction;
            2. table of friction terms, as in `SampleTorque`;
            3. smoothing of the sign of these terms;
            4. speeds of the actuators at x = 1, shape (points, n);
            5. true if an actuator reverses or rests in an interval, shape (points - 1, n).
        length: Shape (points,). Grid of the path length.
        most: Shape (points,). Largest x that the speed limits allow.
        end: x at the end.
        out: Shape (points,). Written.
    """
    joints, table, smoothing, speed, both = friction
    here, there, room = np.empty((4, speed.shape[1])), np.empty((4, speed.shape[1])), np.empty(5)
    last = len(rows) - 1
    out[last] = min(end, most[last])
    for i in range(last - 1, -1, -1):
        twice_step = 2.0 * (length[i + 1] - length[i])
        x, goal = most[i], out[i + 1]
        for step in range(STEPS):
            friction_at(table, smoothing, speed[i], both[i], x, here)
            friction_at(table, smoothing, speed[i + 1], both[i], goal, there)
            _initial_interval(room, x, twice_step, out[i + 1])
            _feasible_interval(rows[i], bounds[i], joints, here, x, 0.0, x, room)
            _feasible_interval(rows[i + 1], bounds[i + 1], joints, there, x, twice_step, goal, room)
            if room[ALONE] < 0.0:
                middle = x + twice_step * 0.5 * (room[LEAST] + room[MOST])
                before, goal = goal, min(max(middle, 0.0), out[i + 1])
                settled = abs(goal - before) <= 1e-6 * (goal + before) or step > STEPS // 2
            else:
                settled = True
            if _is_feasible(room):
                if settled:
                    break
            else:
                x = _resume_speed(room, x)
        out[i] = x


@kernel
def forwards(
    rows: FloatArray,
    bounds: FloatArray,
    friction: FrictionArrays,
    length: FloatArray,
    largest: FloatArray,
    start: float,
    x: FloatArray,
    u: FloatArray,
) -> int:
    """Fill x (points,) and u (points - 1,) with the fastest motion; return the failed point or -1.

    `largest` is the result of `backwards`; the other arguments are those of `backwards`. The pass
    can fail if friction makes the feasible set non-convex: a slower motion exists, but the pass
    does not find it.
    """
    joints, table, smoothing, speed, both = friction
    here, there, room = np.empty((4, speed.shape[1])), np.empty((4, speed.shape[1])), np.empty(5)
    x[0] = start
    for i in range(len(rows) - 1):
        twice_step = 2.0 * (length[i + 1] - length[i])
        friction_at(table, smoothing, speed[i], both[i], x[i], here)
        goal = largest[i + 1]
        for _ in range(STEPS):
            friction_at(table, smoothing, speed[i + 1], both[i], goal, there)
            _initial_interval(room, x[i], twice_step, largest[i + 1])
            _feasible_interval(rows[i], bounds[i], joints, here, x[i], 0.0, x[i], room)
            _feasible_interval(
                rows[i + 1], bounds[i + 1], joints, there, x[i], twice_step, goal, room
            )
            before = goal
            goal = min(max(x[i] + twice_step * room[MOST], 0.0), largest[i + 1])
            if abs(goal - before) <= 1e-9 * (goal + before):
                break
        size = abs(room[LEAST]) + abs(room[MOST])
        if room[ALONE] >= LOOSE or room[LEAST] - room[MOST] > LOOSE * size:
            return i
        x[i + 1] = goal
        u[i] = (goal - x[i]) / twice_step
    return -1
