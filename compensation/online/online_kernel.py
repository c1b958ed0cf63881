"""One cycle of the on-line compensation: compiled, without memory allocation.

The head is the point of the path for which the feedforward is computed. It is some cycles ahead of
the set-points that are sent, because the drives need their speeds in advance. At the head, the
model torque passes the inverse of each velocity loop,

    v_ff = v + e ,    tau = K_p e + x ,    x' = (K_p / T_i) e ,

in which x is the torque of the loop's integrator. At the start, x is the torque at rest; therefore
a robot at rest needs no correction. If e is limited, x is computed with the limited value, as in
the drive's own integrator (anti-windup).

Presliding hysteresis is computed at the head:
- Until the path leaves its first point, the state of the hysteresis comes from the measured
  approach and settling of the joints.
- The drive's integrator holds a joint at rest, whatever the direction of its stiction. Therefore a
  measured state only changes x, without a correction of the speed.

Numba's disk cache notices changes of this file, but not of imported files. After a change in
`path_kernels` or `dynamics.model.one_sample`, delete the cache
(`compensation/online/__pycache__/*.nb*`).
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

# Further rows of `axes`, in addition to those of `path_kernels`.
GAIN: Final = 5  # K_p divided by the tuned scale
OLD: Final = 6  # OLD, NEW: weights of the last and the new torque in the integrator
NEW: Final = 7
DECAY: Final = 8
SHARE: Final = 9  # T / (2 T_i)
MOST: Final = 10  # largest correction [rad/s or m/s]
CYCLES: Final = 11  # whole cycles to look ahead, and the fraction
FRACTION: Final = 12
PRESLIDING: Final = 13  # two rows: presliding distance (0: no hysteresis), presliding fraction
STEP: Final = 15  # largest change of the feedforward in a cycle [rad/s or m/s]
AXES_ROWS: Final = 16

# Further words of `counts`, in addition to those of `path_kernels`.
HEAD: Final = 11  # number of cycles that the head has advanced
DELAY: Final = 12  # number of cycles that the head is ahead of the set-points
RESTED: Final = 13  # cycle of the head in which the path came to rest; -1 before
SUSPENDED_UNTIL: Final = 14  # cycle of the head until which the compensation is suspended
INVALID_TORQUES: Final = 15  # number of cycles with a torque that is not finite
LARGE: Final = 16  # number of cycles with a correction that is too large
LIMITED: Final = 17  # cycles in which torque, speed or acceleration was limited
HOLD: Final = 18  # number of cycles for which the compensation is suspended
FADE: Final = 19  # number of cycles in which the compensation fades in or out
HYSTERETIC: Final = 20  # true if any joint has hysteresis
MEASURING: Final = 21  # true while the hysteresis state comes from the measured motion
COUNTS: Final = 22

WEIGHT: Final = 4  # word of `pace`: fraction of the compensation that is sent
PACE: Final = 5

CARRIED: Final = 0  # rows of `state`: x, latest torque, latest correction, work space
LATEST: Final = 1
ERROR: Final = 2
CHANGE: Final = 3
STATE_ROWS: Final = 4

DRIVEN: Final = 0  # rows of `memory`: hysteresis states of the head's path, measured motion
MEASURED: Final = 1

WANTED: Final = 2  # rows of a place in `line`, after Q and V: speed to send, node
INDEX: Final = 3

POINTS_A_CYCLE: Final = 4
DUST: Final = 1e-9  # rad or m per cycle: a smaller change is rounding, not motion

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
    """Advance path and compensation by one cycle.

    Args:
        counters, rows, model, path: As for `take_points`.
        stage: State of the compensation; `out` is written.

    Returns:
        True if the motion is over and `out` is its last set-point.
    """
    axes, nodes, _, counts, pace, _ = path
    line, state, memory, found, head, out = stage
    n, places = out.shape[1], line.shape[0]
    most = int(np.int64(POINTS_A_CYCLE))  # with a literal, Numba would compile a second version
    limited_before = counts[LIMITED]
    take_points(counters, rows, model, path, most)
    torque = out[0]
    if counts[MEASURING]:
        _adopt_measured_state(
            model, axes[PRESLIDING : PRESLIDING + 2], memory, found, state, head, torque
        )
    known = advance(path, head)
    h = counts[HEAD]
    if counts[RESTED] < 0 and counts[STATE] >= STOPPED:
        counts[RESTED] = h
    place = line[h % places]
    if counts[HYSTERETIC]:
        for j in range(n):
            if abs(head[Q, j] - memory[DRIVEN, j, LAST]) > DUST:
                counts[MEASURING] = 0
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
    rising = h >= counts[SUSPENDED_UNTIL] and not resting and at >= 0
    over = resting and pace[WEIGHT] == 0.0
    change = 1.0 / counts[FADE]
    pace[WEIGHT] = min(max(pace[WEIGHT] + (change if rising else -change), 0.0), 1.0)
    limited = False
    for j in range(n):
        begin = at + int(axes[CYCLES, j])
        share = axes[FRACTION, j]
        now, then = line[begin % places], line[(begin + 1) % places]
        present = line[at % places]
        wanted = (1.0 - share) * now[WANTED, j] + share * then[WANTED, j]
        out[0, j] = present[Q, j]
        out[1, j] = present[V, j]
        fed = present[V, j] + pace[WEIGHT] * (wanted - present[V, j])
        fed = min(max(fed, -axes[SPEED, j]), axes[SPEED, j])
        # limits the speed's change to the joint's acceleration, whatever the model torque
        sent = min(max(fed, out[2, j] - axes[STEP, j]), out[2, j] + axes[STEP, j])
        limited = limited or sent != fed
        out[2, j] = sent
    if limited:
        counts[LIMITED] = limited_before + 1
    return bool(over)


@kernel
def observe_position(
    position: FloatArray, axes: FloatArray, memory: FloatArray, found: FloatArray
) -> None:
    """Update the measured hysteresis from a position (n,), during the approach and at the start."""
    update_presliding(position, axes[PRESLIDING : PRESLIDING + 2], memory[MEASURED], found)


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
    """Use the measured hysteresis at the head; add the change of torque to the integrators.

    The head's torques with the old and the new state are subtracted, so that torques without
    hysteresis cancel.
    """
    n = len(torque)
    update_presliding(head[Q], presliding, memory[DRIVEN], found)
    hysteretic_torque(model, head[0], head[1], head[2], found, torque)
    for j in range(n):
        state[CHANGE, j] = -torque[j]
        memory[DRIVEN, j] = memory[MEASURED, j]
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
    """Compute the speed to send from the head's torque, within limits; update the integrators."""
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
            change = axes[SHARE, j] * axes[GAIN, j] * (state[ERROR, j] + bounded)
            carried = before + change
            wanted = carried + axes[GAIN, j] * bounded
        state[CARRIED, j], state[LATEST, j], state[ERROR, j] = carried, wanted, bounded
        place[Q, j], place[V, j] = head[Q, j], speed
        place[WANTED, j] = speed + bounded
    if limited:
        counts[LIMITED] += 1
    if doubt:
        counts[INVALID_TORQUES] += 1
    if large:
        counts[LARGE] += 1
    if doubt or large:
        counts[SUSPENDED_UNTIL] = counts[HEAD] + counts[HOLD]
