"""Kernels that turn points into a path that can be driven and stopped, without memory allocation.

A point is accepted only if the path through it is within all limits. Accepted points can therefore
be driven at full rate or slower. The path between two points is a quintic: it has the points'
positions, with velocities and accelerations from five-point differences. It stays within the hull
of its Bezier control points, so these are checked against the limits.

`rate_kernels` contains the kernels that run along the path.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

from compensation.online.load_kernels import (
    LoadArrays,
    possible_loads,
    set_load,
    set_whole_load,
)
from compensation.online.point_ring import READ, TOTAL, WRITTEN
from config.arrays import FloatArray, IntArray
from dynamics.kernels.simd import kernel
from dynamics.model.one_sample import ModelArrays, sample_torque

Q: Final = 0  # rows of a node: position, velocity, acceleration, torque at full rate
V: Final = 1
A: Final = 2
TAU: Final = 3
# Rows of a node, for the segment that ends there: largest speed, smallest forward acceleration.
MAX_SPEED: Final = 4
MIN_ACCELERATION: Final = 5  # of both directions if the joint reverses in the segment
NODE_ROWS: Final = 6

# Rows of `axes`, one column per joint.
LOW: Final = 0
HIGH: Final = 1
SPEED: Final = 2
ACCELERATION: Final = 3
TORQUE: Final = 4

# Words of `counts`.
FILLED: Final = 0  # number of nodes with a position, including the extra ones BEFORE and BEHIND
KNOWN: Final = 1  # number of nodes with velocity and acceleration, within all limits
NODE: Final = 2  # the last node that the robot has passed
SAFE: Final = 3  # the last node that can be reached at full rate
PROFILE: Final = 4  # index of the valid profile
HORIZON: Final = 5  # last node of the valid profile
STATE: Final = 6
CLOSED: Final = 7
REASON: Final = 8  # REASON, REASON_JOINT, REASON_POINT: reason, joint and number of a refused point
REASON_JOINT: Final = 9
REASON_POINT: Final = 10
SIGNALLED: Final = 11  # true if a change of the load begins at a signal

DRIVING: Final = 0
BRAKING: Final = 1
STOPPED: Final = 2
ARRIVED: Final = 3

OPEN: Final = 0
ENDED: Final = 1
REFUSED: Final = 2

NOT_FINITE: Final = 1
POSITION_LIMIT: Final = 2
SPEED_LIMIT: Final = 3
ACCELERATION_LIMIT: Final = 4
TORQUE_LIMIT: Final = 5
MOTOR_SPEED_LIMIT: Final = 6

# Words of `pace`.
OFFSET: Final = 0  # time into the segment at full rate [s]
RATE: Final = 1  # rate of the path: path time per time
FOUND: Final = 2  # FOUND, ALLOWED: value of a refused point, and the limit
ALLOWED: Final = 3

BEFORE: Final = 2  # nodes before the first point, at which the robot rests
BEHIND: Final = 4  # nodes after the last point, at which the robot rests
SPARE: Final = 12

PathArrays: TypeAlias = tuple[FloatArray, FloatArray, FloatArray, IntArray, FloatArray, float]
"""State of the path.

`axes` (5 or more, n): the first five rows are the limits; callers use further ones. `nodes`
(nodes, 6, n): ring buffer, index modulo length. `profiles` (2, nodes): squared rate of the path at
each node, valid and on trial. `counts` and `pace`: the elements named above; callers use further
ones. Sixth element of the tuple: the time between points [s].
"""


@kernel
def take_points(
    counters: IntArray,
    rows: FloatArray,
    model: ModelArrays,
    loads: LoadArrays,
    path: PathArrays,
    most: int,
) -> None:
    """Move up to `most` points from the ring to the path while the path has room.

    Args:
        counters, rows: Arrays of the `PointRing`.
        model: `SampleTorque.arrays`.
        loads: Loads of the path.
        most: Largest number of points.
    """
    axes, nodes, _, counts, pace, _ = path
    total, written, read = counters[TOTAL], counters[WRITTEN], counters[READ]
    length, n = nodes.shape[0], nodes.shape[2]
    moved = 0
    while (
        counts[CLOSED] == OPEN
        and read < written
        and moved < most
        and counts[FILLED] - counts[NODE] < length - SPARE
    ):
        point = rows[read % len(rows)]
        read += 1
        moved += 1
        for j in range(n):
            if not math.isfinite(point[j]):
                _refuse(counts, pace, NOT_FINITE, j, read - 1, point[j], 0.0)
            elif not axes[LOW, j] <= point[j] <= axes[HIGH, j]:
                limit = axes[LOW, j] if point[j] < axes[LOW, j] else axes[HIGH, j]
                _refuse(counts, pace, POSITION_LIMIT, j, read - 1, point[j], limit)
            if counts[CLOSED] != OPEN:
                break
        if counts[CLOSED] == OPEN:
            for _ in range(1 + (BEFORE if counts[FILLED] == 0 else 0)):
                _push(point, model, loads, path)
    counters[READ] = read
    room = counts[FILLED] - counts[NODE] < length - SPARE
    if counts[CLOSED] == OPEN and 0 <= total == read and counts[FILLED] > 0 and room:
        last = nodes[(counts[FILLED] - 1) % length, Q]
        for _ in range(BEHIND):
            if counts[CLOSED] == OPEN:
                _push(last, model, loads, path)
        if counts[CLOSED] == OPEN:
            counts[CLOSED] = ENDED


@kernel
def _refuse(
    counts: IntArray,
    pace: FloatArray,
    why: int,
    joint: int,
    point: int,
    found: float,
    allowed: float,
) -> None:
    if counts[CLOSED] == OPEN:
        counts[CLOSED], counts[REASON], counts[REASON_JOINT], counts[REASON_POINT] = (
            REFUSED,
            why,
            joint,
            point,
        )
        pace[FOUND], pace[ALLOWED] = found, allowed


@kernel
def _push(point: FloatArray, model: ModelArrays, loads: LoadArrays, path: PathArrays) -> None:
    """Append a node, and check the node two places before it, whose neighbours are now known."""
    axes, nodes, _, counts, pace, step_s = path
    length, n = nodes.shape[0], nodes.shape[2]
    own = nodes[counts[FILLED] % length, Q]
    for j in range(n):
        own[j] = point[j]
    counts[FILLED] += 1
    k = counts[FILLED] - 3
    if k < 0:
        return
    a2, a1 = nodes[max(k - 2, 0) % length, Q], nodes[max(k - 1, 0) % length, Q]
    b1, b2 = nodes[(k + 1) % length, Q], nodes[(k + 2) % length, Q]
    node = nodes[k % length]
    for j in range(n):
        node[V, j] = (8.0 * (b1[j] - a1[j]) - (b2[j] - a2[j])) / (12.0 * step_s)
        bend = 16.0 * (b1[j] + a1[j]) - 30.0 * node[Q, j] - (b2[j] + a2[j])
        node[A, j] = bend / (12.0 * step_s * step_s)
    which = max(k - BEFORE, 0)
    if k > 0:
        begin = nodes[(k - 1) % length]
        _check_segment(begin, node, path, which)
        _check_motors(begin, node, model[5][1], path, which)
    time_s = (k - BEFORE) * step_s
    set_load(model, loads, time_s)
    first, last = possible_loads(loads, time_s) if counts[SIGNALLED] else (0, 0)
    for load in range(last, first - 1, -1):
        if counts[SIGNALLED]:
            set_whole_load(model, loads, load)
        sample_torque(model, node[Q], node[V], node[A], node[TAU])
        for j in range(n):
            limit = axes[TORQUE, j]
            if abs(node[TAU, j]) > limit:  # NaN is accepted: it suspends the compensation
                _refuse(counts, pace, TORQUE_LIMIT, j, which, node[TAU, j], limit)
    if counts[CLOSED] == OPEN:
        counts[KNOWN] = k + 1


@kernel
def _check_segment(begin: FloatArray, end: FloatArray, path: PathArrays, which: int) -> None:
    """Check the control points of the quintic between two nodes against the limits."""
    axes, _, _, counts, pace, h = path
    for j in range(begin.shape[1]):
        p0, p5 = begin[Q, j], end[Q, j]
        p1, p2, p3, p4 = _inner_points(begin, end, j, h)
        low = min(p0, p1, p2, p3, p4, p5)
        high = max(p0, p1, p2, p3, p4, p5)
        slack = 1e-9 + 0.01 * abs(p5 - p0)
        if low < axes[LOW, j] - slack:
            _refuse(counts, pace, POSITION_LIMIT, j, which, low, axes[LOW, j])
        if high > axes[HIGH, j] + slack:
            _refuse(counts, pace, POSITION_LIMIT, j, which, high, axes[HIGH, j])
        v1, v2, v3 = 5.0 * (p2 - p1) / h, 5.0 * (p3 - p2) / h, 5.0 * (p4 - p3) / h
        slowest = min(begin[V, j], v1, v2, v3, end[V, j])
        fastest = max(begin[V, j], v1, v2, v3, end[V, j])
        speed = max(fastest, -slowest)
        if not speed <= axes[SPEED, j]:
            _refuse(counts, pace, SPEED_LIMIT, j, which, speed, axes[SPEED, j])
        a1, a2 = 4.0 * (v2 - v1) / h, 4.0 * (v3 - v2) / h
        least = min(begin[A, j], a1, a2, end[A, j])
        most = max(begin[A, j], a1, a2, end[A, j])
        size = max(most, -least)
        if not size <= axes[ACCELERATION, j]:
            _refuse(counts, pace, ACCELERATION_LIMIT, j, which, size, axes[ACCELERATION, j])
        end[MAX_SPEED, j] = speed
        end[MIN_ACCELERATION, j] = -size
        if slowest >= 0.0:
            end[MIN_ACCELERATION, j] = least
        elif fastest <= 0.0:
            end[MIN_ACCELERATION, j] = -most


@kernel
def _check_motors(
    begin: FloatArray, end: FloatArray, motors_by_joints: FloatArray, path: PathArrays, which: int
) -> None:
    """Check the motors' speeds at the control points between two nodes against the limits."""
    axes, _, _, counts, pace, h = path
    n = begin.shape[1]
    for i in range(n):
        w0 = w1 = w2 = w3 = w4 = 0.0
        for j in range(n):
            p1, p2, p3, p4 = _inner_points(begin, end, j, h)
            share = motors_by_joints[i, j]
            w0 += share * begin[V, j]
            w1 += share * 5.0 * (p2 - p1) / h
            w2 += share * 5.0 * (p3 - p2) / h
            w3 += share * 5.0 * (p4 - p3) / h
            w4 += share * end[V, j]
        speed = max(abs(w0), abs(w1), abs(w2), abs(w3), abs(w4))
        if not speed <= axes[SPEED, i]:
            _refuse(counts, pace, MOTOR_SPEED_LIMIT, i, which, speed, axes[SPEED, i])


@kernel
def _inner_points(
    begin: FloatArray, end: FloatArray, j: int, h: float
) -> tuple[float, float, float, float]:
    """Return the inner four control points of a joint's position between two nodes."""
    p1 = begin[Q, j] + 0.2 * h * begin[V, j]
    p4 = end[Q, j] - 0.2 * h * end[V, j]
    p2 = begin[Q, j] + 0.4 * h * begin[V, j] + 0.05 * h * h * begin[A, j]
    p3 = end[Q, j] - 0.4 * h * end[V, j] + 0.05 * h * h * end[A, j]
    return p1, p2, p3, p4
