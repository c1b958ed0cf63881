"""Kernels that turn points into a path that can be driven and stopped, without memory allocation.

A point is accepted only if the path through it is within all limits. Accepted points can therefore
be driven at full rate or slower. The path between two points is a quintic: it has the positions of
the points, and velocities and accelerations from five-point differences. As a Bezier curve, the
quintic stays within the hull of its control points, so the control points are checked against the
limits.

The rate is the path's speed relative to full speed, and x is its square. A pass backwards over the
points finds the highest rate from which the path can still stop before its last known point, as in
TOPP-RA (Pham and Pham 2018):
1. At the last point, x is 0.
2. At each earlier point, x is the largest value from which the next point can be reached within the
   joints' accelerations on the whole segment.
3. While x is 1 at the present point, the path runs at full rate. Otherwise it follows the computed
   profile down to rest.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

from compensation.online.point_ring import READ, TOTAL, WRITTEN
from config.arrays import FloatArray, IntArray
from dynamics.kernels.simd import kernel
from dynamics.model.one_sample import ModelArrays, sample_torque

Q: Final = 0  # rows of a node: position, velocity, acceleration, torque at full rate
V: Final = 1
A: Final = 2
TAU: Final = 3
# Rows of a node for the segment that ends at it: largest speed, least acceleration forwards.
MAX_SPEED: Final = 4
MIN_ACCELERATION: Final = 5  # if the joint reverses in the segment, in either direction
NODE_ROWS: Final = 6

# Rows of `axes`, one column per joint.
LOW: Final = 0
HIGH: Final = 1
SPEED: Final = 2
ACCELERATION: Final = 3
TORQUE: Final = 4

# Words of `counts`.
FILLED: Final = 0  # number of nodes with a position: extra nodes are BEFORE and BEHIND
KNOWN: Final = 1  # number of nodes with velocity and acceleration, within all limits
NODE: Final = 2  # the last node passed
SAFE: Final = 3  # the last node that can be reached at full rate
PROFILE: Final = 4  # index of the valid profile
HORIZON: Final = 5  # last node of the valid profile
STATE: Final = 6
CLOSED: Final = 7
REASON: Final = 8  # REASON, REASON_JOINT, REASON_POINT: reason, joint and number of a refused point
REASON_JOINT: Final = 9
REASON_POINT: Final = 10

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

# Words of `pace`.
OFFSET: Final = 0  # time into the segment at full rate [s]
RATE: Final = 1  # path time per time
FOUND: Final = 2  # FOUND, ALLOWED: value of a refused point, and the limit
ALLOWED: Final = 3

BEFORE: Final = 2  # nodes before the first point, at which the robot rests
BEHIND: Final = 4  # nodes after the last point, at which the robot rests
SPARE: Final = 12

PathArrays: TypeAlias = tuple[FloatArray, FloatArray, FloatArray, IntArray, FloatArray, float]
"""State of the path.

`axes` (5 or more, n): limits. `nodes` (nodes, 6, n): ring buffer, index modulo length. `profiles`
(2, nodes): the valid profile and a trial. `counts` and `pace`: the words named above. The last
element is the time between points [s].
"""


@kernel
def take_points(
    counters: IntArray,
    rows: FloatArray,
    model: ModelArrays,
    path: PathArrays,
    most: int,
) -> None:
    """Move up to `most` points from the ring to the path while the path has room.

    Args:
        counters, rows: Arrays of the `PointRing`.
        model: `SampleTorque.arrays`.
        most: Largest number of points.
    """
    axes, nodes, _, counts, pace, _ = path
    total, written = counters[TOTAL], counters[WRITTEN]
    read = counters[READ]
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
                _push(point, model, path)
    counters[READ] = read
    room = counts[FILLED] - counts[NODE] < length - SPARE
    if counts[CLOSED] == OPEN and 0 <= total == read and counts[FILLED] > 0 and room:
        last = nodes[(counts[FILLED] - 1) % length, Q]
        for _ in range(BEHIND):
            if counts[CLOSED] == OPEN:
                _push(last, model, path)
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
def _push(point: FloatArray, model: ModelArrays, path: PathArrays) -> None:
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
        _check_segment(nodes[(k - 1) % length], node, path, which)
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
        p1, p4 = p0 + 0.2 * h * begin[V, j], p5 - 0.2 * h * end[V, j]
        p2 = p0 + 0.4 * h * begin[V, j] + 0.05 * h * h * begin[A, j]
        p3 = p5 - 0.4 * h * end[V, j] + 0.05 * h * h * end[A, j]
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
def plan_stop(path: PathArrays, which: int) -> int:
    """Fill a profile of x, the squared rate, that ends at rest; return the last safe node.

    If the path's end is known, the profile ends there at full rate, because the path itself ends at
    rest. A node is safe if the path can run from the present node to it at full rate. If not even
    the present node is safe, the node before it is returned.
    """
    axes, nodes, profiles, counts, _, step_s = path
    profile = profiles[which]
    length, n = nodes.shape[0], nodes.shape[2]
    last = counts[KNOWN] - 1
    x = 1.0 if counts[CLOSED] == ENDED else 0.0
    profile[last % length] = x
    twice = 2.0 * step_s
    for i in range(last - 1, counts[NODE] - 1, -1):
        segment = nodes[(i + 1) % length]
        best = 1.0
        for j in range(n):
            limit = axes[ACCELERATION, j]
            speed, least = segment[MAX_SPEED, j], segment[MIN_ACCELERATION, j]
            if least < 0.0:  # the bound is tightest at the end with the higher rate
                best = min(best, (speed * x + twice * limit) / (speed - twice * least))
            elif speed > 1e-12:
                best = min(best, x + twice * (limit + least * x) / speed)
        x = max(best, 0.0)
        profile[i % length] = x
    safe = counts[NODE] - 1
    while safe < last and profile[(safe + 1) % length] == 1.0:
        safe += 1
    return int(safe)


@kernel
def advance(path: PathArrays, head: FloatArray) -> bool:
    """Advance the path's head by one cycle.

    Args:
        head: Shape (3, n). Position, velocity and acceleration of the path; written.

    Returns:
        True if the head is at a node and runs at full rate; the node's torque then applies.
    """
    _, nodes, profiles, counts, pace, step_s = path
    length = nodes.shape[0]
    if counts[STATE] == DRIVING:
        ahead = counts[NODE] + 1
        if counts[CLOSED] == ENDED and ahead >= counts[KNOWN]:
            counts[STATE] = ARRIVED
        elif ahead > counts[SAFE]:
            other = 1 - counts[PROFILE]
            safe = plan_stop(path, other)
            if safe >= counts[NODE]:  # the new profile is valid from the present node on
                counts[PROFILE], counts[SAFE], counts[HORIZON] = other, safe, counts[KNOWN] - 1
            if ahead > counts[SAFE]:
                counts[STATE] = BRAKING
                pace[OFFSET], pace[RATE] = 0.0, 1.0
        if counts[STATE] == DRIVING:
            counts[NODE] = ahead
    change = 0.0
    if counts[STATE] == BRAKING:
        change = _follow_profile(counts, profiles[counts[PROFILE]], pace, step_s)
    node = nodes[counts[NODE] % length]
    if counts[STATE] == BRAKING:
        _evaluate_segment(node, nodes[(counts[NODE] + 1) % length], pace, change, step_s, head)
        return False
    moving = counts[STATE] == DRIVING
    for j in range(head.shape[1]):
        head[Q, j] = node[Q, j]
        head[V, j] = node[V, j] if moving else 0.0
        head[A, j] = node[A, j] if moving else 0.0
    return bool(moving)


@kernel
def _follow_profile(
    counts: IntArray, profile: FloatArray, pace: FloatArray, step_s: float
) -> float:
    """Advance one cycle along a profile; return the rate's derivative at the cycle's end [1/s]."""
    length, last = len(profile), counts[HORIZON]
    left, change = step_s, 0.0
    while left > 0.0:
        i = counts[NODE]
        if i >= last:
            counts[STATE] = STOPPED
            return 0.0
        x, x_there = float(profile[i % length]), float(profile[(i + 1) % length])
        change = (x_there - x) / (2.0 * step_s)
        rate_there = math.sqrt(x_there)
        both = pace[RATE] + rate_there
        if both <= 1e-12:
            counts[STATE] = STOPPED
            return 0.0
        needed = 2.0 * (step_s - pace[OFFSET]) / both
        if needed <= left:
            left -= needed
            counts[NODE] = i + 1
            pace[OFFSET], pace[RATE] = 0.0, rate_there
        else:
            pace[OFFSET] += pace[RATE] * left + 0.5 * change * left * left
            pace[RATE] = max(pace[RATE] + change * left, 0.0)
            left = 0.0
    if counts[NODE] >= last:
        counts[STATE] = STOPPED
        return 0.0
    return change


@kernel
def _evaluate_segment(
    begin: FloatArray,
    end: FloatArray,
    pace: FloatArray,
    change: float,
    step_s: float,
    head: FloatArray,
) -> None:
    """Evaluate the quintic between two nodes at the present rate and its derivative `change`."""
    h, rate = step_s, pace[RATE]
    x = pace[OFFSET] / h
    for j in range(head.shape[1]):
        v0, v1 = h * begin[V, j], h * end[V, j]
        a0, a1 = h * h * begin[A, j], h * h * end[A, j]
        rest = end[Q, j] - begin[Q, j] - v0 - 0.5 * a0
        slope, bend = v1 - v0 - a0, a1 - a0
        c3 = 10.0 * rest - 4.0 * slope + 0.5 * bend
        c4 = -15.0 * rest + 7.0 * slope - bend
        c5 = 6.0 * rest - 3.0 * slope + 0.5 * bend
        head[Q, j] = begin[Q, j] + x * (v0 + x * (0.5 * a0 + x * (c3 + x * (c4 + x * c5))))
        speed = (v0 + x * (a0 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))) / h
        curve = (a0 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5))) / (h * h)
        head[V, j] = speed * rate
        head[A, j] = curve * rate * rate + speed * change
