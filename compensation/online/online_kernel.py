"""One cycle of the on-line compensation: compiled, without memory allocation.

The path's head is some cycles ahead of the set-points that are sent, because the drives need their
speeds in advance. At the head, the model torque passes the inverse of each velocity loop,

    v_ff = v + e ,    tau = K_p e + x ,    x' = (K_p / T_i) e ,

in which x is the torque of the loop's integrator. At the start, x is the torque at rest; therefore
a robot at rest needs no correction. If e is limited, x is computed with the limited value, as in
the drive's own integrator (anti-windup).

Presliding hysteresis is computed at the head:
- Until the path leaves its first point, the state of the hysteresis comes from the measured
  approach and settling of the joints.
- The drive's integrator holds a joint at rest, whatever the direction of its stiction. Therefore a
  measured state changes x and causes no correction.

Numba's disk cache notices changes in this file only. After a change in `path_kernels` or
`dynamics.model.one_sample`, delete the cache (`compensation/online/__pycache__/*.nb*`).
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
from dynamics.model.hysteretic_sample import LAST, hysteretic_torque, update_presliding
from dynamics.model.one_sample import ModelArrays, sample_torque

# More rows of `axes`.
GAIN: Final = 5  # K_p over the tuned scale
OLD: Final = 6  # share of a torque, linear over a cycle, that the integrator takes
NEW: Final = 7
DECAY: Final = 8
SHARE: Final = 9  # T / (2 T_i)
MOST: Final = 10  # largest correction [rad/s or m/s]
CYCLES: Final = 11  # whole cycles to look ahead, and the fraction
FRACTION: Final = 12
PRESLIDING: Final = 13  # presliding distance, 0 for joints without hysteresis, and share: two rows
STEP: Final = 15  # largest change of the feedforward in a cycle [rad/s or m/s]
AXES_ROWS: Final = 16

# More words of `counts`.
HEAD: Final = 11  # cycles of the head so far
DELAY: Final = 12  # cycles from the head to the set-points
RESTED: Final = 13  # the head's cycle at which the path was at rest, -1 before
DOUBTED: Final = 14  # the head's cycle until which the compensation is in doubt
DOUBTS: Final = 15  # doubts so far: torque, correction
LARGE: Final = 16
LIMITED: Final = 17  # cycles in which torque, speed or acceleration was limited
HOLD: Final = 18  # cycles of a doubt
FADE: Final = 19  # cycles of fading
REMEMBERS: Final = 20  # true if any joint has hysteresis
SEEING: Final = 21  # true while the measured state counts
COUNTS: Final = 22

WEIGHT: Final = 4  # of `pace`: fraction of the compensation that is sent
PACE: Final = 5

CARRIED: Final = 0  # rows of the inverse's state: x, latest torque, latest correction, and room
LATEST: Final = 1
ERROR: Final = 2
CHANGE: Final = 3
STATE_ROWS: Final = 4

DRIVEN: Final = 0  # hysteresis states: along the head's path, and along the measured motion
SEEN: Final = 1

WANTED: Final = 2  # of the line, in addition to Q and V: speed to send
INDEX: Final = 3

POINTS_A_CYCLE: Final = 4
DUST: Final = 1e-9  # rad or m per cycle: rounding of points at rest

StageArrays: TypeAlias = tuple[
    FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray
]
"""State of the compensation.

`line` (places, 4, n): rows that the head has passed and that have not been sent. `state`
(STATE_ROWS, n): inverse of the velocity loops. `memory` (2, n, STATE): hysteresis states. `found`
(n, FOUND): work space. `head` (3, n): the path's head. `out` (3, n): position, velocity and
feedforward to send.
"""


@kernel
def next_set_point(
    counters: IntArray,
    rows: FloatArray,
    model: ModelArrays,
    path: PathArrays,
    stage: StageArrays,
) -> bool:
    """Advance by one cycle.

    Args:
        counters, rows, model, path: As for `take_points`.
        stage: State of the compensation; `out` is written.

    Returns:
        True if the motion is over and `out` is its last set-point.
    """
    axes, nodes, _, counts, pace, _ = path
    line, state, memory, found, head, out = stage
    n, places = out.shape[1], line.shape[0]
    most = int(np.int64(POINTS_A_CYCLE))  # a literal would compile a separate version
    limited_before = counts[LIMITED]
    take_points(counters, rows, model, path, most)
    torque = out[0]
    if counts[SEEING]:
        _adopt_measured_state(
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
        update_presliding(head[Q], axes[PRESLIDING : PRESLIDING + 2], memory[DRIVEN], found)
        hysteretic_torque(model, head[0], head[1], head[2], found, torque)
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
        # the joint's acceleration limit holds for any model torque
        told = min(max(fed, out[2, j] - axes[STEP, j]), out[2, j] + axes[STEP, j])
        limited = limited or told != fed
        out[2, j] = told
    if limited:
        counts[LIMITED] = limited_before + 1
    return bool(over)


@kernel
def observe_position(
    position: FloatArray, axes: FloatArray, memory: FloatArray, found: FloatArray
) -> None:
    """Update the measured state from a position (n,), on the way to the path and at its start."""
    update_presliding(position, axes[PRESLIDING : PRESLIDING + 2], memory[SEEN], found)


@kernel
def _adopt_measured_state(
    model: ModelArrays,
    presliding: FloatArray,
    memory: FloatArray,
    found: FloatArray,
    state: FloatArray,
    head: FloatArray,
    torque: FloatArray,
) -> None:
    """Move the measured state into the head, and its change of torque into the integrators.

    The head's torques before and after are compared, so that its other torques are kept.
    """
    n = len(torque)
    update_presliding(head[Q], presliding, memory[DRIVEN], found)
    hysteretic_torque(model, head[0], head[1], head[2], found, torque)
    for j in range(n):
        state[CHANGE, j] = -torque[j]
        memory[DRIVEN, j] = memory[SEEN, j]
        memory[DRIVEN, j, LAST] = head[Q, j]
    update_presliding(head[Q], presliding, memory[DRIVEN], found)
    hysteretic_torque(model, head[0], head[1], head[2], found, torque)
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
    """Turn the head's torque into a speed to send, within limits, and update the integrators."""
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
