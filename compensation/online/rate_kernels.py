"""Kernels that run along a path, at full rate or slower, without memory allocation.

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

from compensation.online.path_kernels import (
    ACCELERATION,
    ARRIVED,
    BRAKING,
    CLOSED,
    DRIVING,
    ENDED,
    HORIZON,
    KNOWN,
    MAX_SPEED,
    MIN_ACCELERATION,
    NODE,
    OFFSET,
    PROFILE,
    RATE,
    REFUSED,
    SAFE,
    STATE,
    STOPPED,
    A,
    PathArrays,
    Q,
    V,
)
from config.arrays import FloatArray, IntArray
from dynamics.kernels.simd import kernel


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
            # the bound is lowest at the end of the segment that has the higher rate
            if least < 0.0:
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
def cut_path(path: PathArrays) -> None:
    """End the path as soon as possible: the robot brakes at once, and rests on the path.

    Nothing changes if the path is braking already, or has ended.
    """
    _, _, _, counts, _, _ = path
    if counts[STATE] != DRIVING:
        return
    counts[CLOSED] = REFUSED
    other = 1 - counts[PROFILE]
    low, high = counts[NODE] + 1, counts[KNOWN]  # too few nodes; enough nodes
    while high - low > 1:
        counts[KNOWN] = (low + high) // 2
        if plan_stop(path, other) >= counts[NODE]:
            high = counts[KNOWN]
        else:
            low = counts[KNOWN]
    counts[KNOWN] = high
    counts[SAFE] = plan_stop(path, other)
    counts[PROFILE], counts[HORIZON] = other, high - 1


@kernel
def advance(path: PathArrays, head: FloatArray) -> bool:
    """Advance the point for which the feedforward is computed (the head) by one cycle.

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
