"""One cycle of the on-line compensation: compiled, nothing allocated.

The path's head runs some cycles before the set-points that are handed out, so that the speeds that
the drives need in advance are known. At the head the model's torque goes through the inverse of
each velocity loop,

    v_ff = v + e ,    tau = K_p e + x ,    x' = (K_p / T_i) e ,

with x the torque that the loop's integrator carries: it starts as the torque at rest, so that a
resting robot is asked for nothing. Where e has to be limited, x follows the limited one, as the
drive's own integrator does: nothing winds up.

Friction that remembers follows the head. Until the path leaves its first point, joints remember
what was seen of them: the way to the start, and how they settled there. A joint that stands is
carried by its integrator whichever way it sticks, so what is seen changes x and asks for nothing.

Numba's cache on disk notices a change in this file only: after one in `path_kernels` or in
`dynamics.model.one_sample`, remove the cache (`compensation/online/__pycache__/*.nb*`).
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np

from compensation.online.path_kernels import (
    NODE,
    SPEED,
    STATE,
    STOPPED,
    TAU,
    TORQUE,
    PathArrays,
    Q,
    V,
    advance,
    take_points,
)
from config.arrays import FloatArray, IntArray
from dynamics.kernels.simd import kernel
from dynamics.model.one_sample import ModelArrays, sample_torque
from dynamics.model.remembered_sample import LAST, go_to, remembered_torque

# More rows of `axes`.
GAIN: Final = 5  # K_p over the tuned scale
OLD: Final = 6  # of a torque that is linear over a cycle: what of it the integrator takes
NEW: Final = 7
DECAY: Final = 8
SHARE: Final = 9  # T / (2 T_i)
MOST: Final = 10  # largest correction [rad/s or m/s]
CYCLES: Final = 11  # whole cycles to look ahead, and the fraction
FRACTION: Final = 12
PRESLIDING: Final = 13  # distance, 0 for joints that remember nothing, and share: two rows
STEP: Final = 15  # largest change of the feedforward in a cycle [rad/s or m/s]
AXES_ROWS: Final = 16

# More words of `counts`.
HEAD: Final = 11  # cycles that the head has gone
DELAY: Final = 12  # cycles by which set-points are behind it
RESTED: Final = 13  # the head's cycle at which the path was at rest, -1 before
DOUBTED: Final = 14  # the head's cycle until which there is doubt
DOUBTS: Final = 15  # doubts so far: torque, correction
LARGE: Final = 16
LIMITED: Final = 17  # cycles in which torque, speed or acceleration was limited
HOLD: Final = 18  # cycles that a doubt lasts
FADE: Final = 19  # cycles that fading takes
REMEMBERS: Final = 20  # whether any joint does
SEEING: Final = 21  # whether what was seen still counts
COUNTS: Final = 22

WEIGHT: Final = 4  # of `pace`: the share of the compensation that is handed out
PACE: Final = 5

CARRIED: Final = 0  # rows of the inverse's state: x, latest torque, latest correction, and room
LATEST: Final = 1
ERROR: Final = 2
CHANGE: Final = 3
STATE_ROWS: Final = 4

DRIVEN: Final = 0  # what joints remember: along the head's path, and along what was seen
SEEN: Final = 1

WANTED: Final = 2  # of the line, beside Q and V: speed to send
INDEX: Final = 3

POINTS_A_CYCLE: Final = 4
DUST: Final = 1e-9  # rad or m in a cycle: rounding of points at rest

StageArrays: TypeAlias = tuple[
    FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray
]
"""What the compensation keeps beside the path.

`line` (places, 4, n): what the head has passed and has not been handed out. `state`
(STATE_ROWS, n): the inverse of the velocity loops. `memory` (2, n, STATE): what joints remember.
`found` (n, FOUND): to compute in. `head` (3, n): where the path's head is. `out` (3, n): position,
velocity, feedforward to hand out.
"""


@kernel
def next_set_point(
    counters: IntArray,
    rows: FloatArray,
    model: ModelArrays,
    path: PathArrays,
    stage: StageArrays,
) -> bool:
    """Go on by one cycle.

    Args:
        counters, rows, model, path: As for `take_points`.
        stage: What is kept; `out` is written.

    Returns:
        Whether the motion is over, and `out` its last set-point.
    """
    axes, nodes, _, counts, pace, _ = path
    line, state, memory, found, head, out = stage
    n, places = out.shape[1], line.shape[0]
    most = int(np.int64(POINTS_A_CYCLE))  # as a literal it would be compiled for by itself
    limited_before = counts[LIMITED]
    take_points(counters, rows, model, path, most)
    torque = out[0]
    if counts[SEEING]:
        _take_what_was_seen(
            model, axes[PRESLIDING : PRESLIDING + 2], memory, found, state, head, torque
        )
    known = advance(path, head)
    h = counts[HEAD]
    if counts[RESTED] < 0 and counts[STATE] >= STOPPED:
        counts[RESTED] = h
    place = line[h % places]
    if counts[REMEMBERS]:
        for j in range(n):
            if abs(head[Q, j] - memory[DRIVEN, j, LAST]) > DUST:
                counts[SEEING] = 0
        go_to(head[Q], axes[PRESLIDING : PRESLIDING + 2], memory[DRIVEN], found)
        remembered_torque(model, head[0], head[1], head[2], found, torque)
    elif known:
        node = nodes[counts[NODE] % nodes.shape[0]]
        for j in range(n):
            torque[j] = node[TAU, j]
    else:
        sample_torque(model, head[0], head[1], head[2], torque)
    _compensate(torque, axes, state, counts, head, place)
    place[INDEX, 0] = counts[NODE]
    counts[HEAD] = h + 1

    at = h - counts[DELAY]
    resting = 0 <= counts[RESTED] <= at
    rising = h >= counts[DOUBTED] and not resting and at >= 0
    over = resting and pace[WEIGHT] == 0.0
    change = 1.0 / counts[FADE]
    pace[WEIGHT] = min(max(pace[WEIGHT] + (change if rising else -change), 0.0), 1.0)
    limited = False
    for j in range(n):
        begin = at + int(axes[CYCLES, j])
        share = axes[FRACTION, j]
        now, then = line[begin % places], line[(begin + 1) % places]
        own = line[at % places]
        wanted = (1.0 - share) * now[WANTED, j] + share * then[WANTED, j]
        out[0, j] = own[Q, j]
        out[1, j] = own[V, j]
        fed = own[V, j] + pace[WEIGHT] * (wanted - own[V, j])
        fed = min(max(fed, -axes[SPEED, j]), axes[SPEED, j])
        # never faster than its joint may accelerate, whatever the model asks for
        told = min(max(fed, out[2, j] - axes[STEP, j]), out[2, j] + axes[STEP, j])
        limited = limited or told != fed
        out[2, j] = told
    if limited:
        counts[LIMITED] = limited_before + 1
    return bool(over)


@kernel
def see(position: FloatArray, axes: FloatArray, memory: FloatArray, found: FloatArray) -> None:
    """Follow where the robot was seen (n,), on its way to the path and on its first point."""
    go_to(position, axes[PRESLIDING : PRESLIDING + 2], memory[SEEN], found)


@kernel
def _take_what_was_seen(
    model: ModelArrays,
    presliding: FloatArray,
    memory: FloatArray,
    found: FloatArray,
    state: FloatArray,
    head: FloatArray,
    torque: FloatArray,
) -> None:
    """Let the head remember what was seen, and the integrators carry what that changes.

    The torques of the head before and after are compared, so that what else it takes stays.
    """
    n = len(torque)
    go_to(head[Q], presliding, memory[DRIVEN], found)
    remembered_torque(model, head[0], head[1], head[2], found, torque)
    for j in range(n):
        state[CHANGE, j] = -torque[j]
        memory[DRIVEN, j] = memory[SEEN, j]
        memory[DRIVEN, j, LAST] = head[Q, j]
    go_to(head[Q], presliding, memory[DRIVEN], found)
    remembered_torque(model, head[0], head[1], head[2], found, torque)
    for j in range(n):
        change = torque[j] + state[CHANGE, j]
        if math.isfinite(change):
            state[CARRIED, j] += change
            state[LATEST, j] += change


@kernel
def _compensate(
    torque: FloatArray,
    axes: FloatArray,
    state: FloatArray,
    counts: IntArray,
    head: FloatArray,
    place: FloatArray,
) -> None:
    """Turn the head's torque into a speed to send, within limits, and keep the integrators'."""
    limited = doubt = large = False
    for j in range(len(torque)):
        wanted = torque[j]
        if not math.isfinite(wanted):
            doubt = True
            wanted = state[LATEST, j]
        limit = axes[TORQUE, j]
        if abs(wanted) > limit:
            limited = True
            wanted = math.copysign(limit, wanted)
        before = state[CARRIED, j]
        carried = axes[DECAY, j] * before + axes[OLD, j] * state[LATEST, j] + axes[NEW, j] * wanted
        error = (wanted - carried) / axes[GAIN, j]
        speed = head[V, j]
        high = min(axes[MOST, j], axes[SPEED, j] - speed)
        low = max(-axes[MOST, j], -axes[SPEED, j] - speed)
        bounded = min(max(error, low), high)
        if bounded != error:
            limited = True
            large = large or abs(error) > axes[MOST, j]
            taken = axes[SHARE, j] * axes[GAIN, j] * (state[ERROR, j] + bounded)
            carried = before + taken
            wanted = carried + axes[GAIN, j] * bounded
        state[CARRIED, j], state[LATEST, j], state[ERROR, j] = carried, wanted, bounded
        place[Q, j], place[V, j] = head[Q, j], speed
        place[WANTED, j] = speed + bounded
    if limited:
        counts[LIMITED] += 1
    if doubt:
        counts[DOUBTS] += 1
    if large:
        counts[LARGE] += 1
    if doubt or large:
        counts[DOUBTED] = counts[HEAD] + counts[HOLD]
