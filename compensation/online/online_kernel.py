"""One cycle of the on-line compensation: compiled, without memory allocation.

The head is the point of the path for which the feedforward is computed. It is some cycles ahead of
the set-points that are sent, because the drives need their speeds in advance. At the head, the
model torque passes the inverse of each velocity loop,

    v_ff = v + e ,    tau = K_p e + x ,    x' = (K_p / T_i) e ,

with the speed v, its correction e, the loop's gain K_p and integral time T_i, and the torque x of
the loop's integrator. At the start, x is the torque at rest; therefore a robot at rest needs no
correction. If e is limited, x is computed with the limited value, as in the drive's own integrator
(anti-windup).

With a coupled wrist, loops, torques, corrections and hysteresis belong to the motors. The speeds to
send are converted to the joints, because position loop and driver expect joint speeds (5.18).

Presliding hysteresis is computed at the head:
- Until the path leaves its first point, the state of the hysteresis comes from the measured
  approach and settling of the joints.
- The drive's integrator holds a joint at rest, whatever the direction of its stiction. Therefore a
  measured state only changes x, without a correction of the speed.

Numba's disk cache notices changes of this file, but not of imported files. After a change in
`path_kernels`, `rate_kernels`, `load_kernels` or `dynamics.model.one_sample`, delete the cache
(`compensation/online/__pycache__/*.nb*`).
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np

from compensation.online.load_kernels import LoadArrays, set_load
from compensation.online.path_kernels import (
    BEFORE,
    BRAKING,
    NODE,
    OFFSET,
    SIGNALLED,
    SPEED,
    STATE,
    STOPPED,
    TAU,
    TORQUE,
    PathArrays,
    Q,
    V,
    take_points,
)
from compensation.online.rate_kernels import advance
from config.arrays import FloatArray, IntArray
from dynamics.kernels.simd import kernel
from dynamics.model.hysteretic_sample import LAST, hysteretic_torque, update_presliding
from dynamics.model.one_sample import ModelArrays, sample_torque

# Rows of the array `axes`, in addition to those of `path_kernels`.
GAIN: Final = 5  # K_p divided by the tuned scale
OLD: Final = 6  # OLD, NEW: weights of the last and the new torque in the integrator
NEW: Final = 7
DECAY: Final = 8
SHARE: Final = 9  # T / (2 T_i)
MOST: Final = 10  # largest correction [rad/s or m/s]
CYCLES: Final = 11  # time to look ahead: whole cycles, and the remaining fraction of a cycle
FRACTION: Final = 12
PRESLIDING: Final = 13  # two rows: presliding distance (0: no hysteresis), presliding fraction
STEP: Final = 15  # largest change of the feedforward in a cycle [rad/s or m/s]
AXES_ROWS: Final = 16

# Elements of the array `counts`, in addition to those of `path_kernels`.
HEAD: Final = 12  # number of cycles that the head (defined above) has advanced
DELAY: Final = 13  # number of cycles that the head is ahead of the set-points
RESTED: Final = 14  # cycle of the head in which the path came to rest; -1 while it moves
SUSPENDED_UNTIL: Final = 15  # cycle of the head until which the compensation is suspended
INVALID_TORQUES: Final = 16  # number of cycles with a torque that is not finite
LARGE: Final = 17  # number of cycles with a correction that is too large
LIMITED: Final = 18  # cycles in which torque, speed or acceleration was limited
HOLD: Final = 19  # number of cycles for which the compensation is suspended
FADE: Final = 20  # number of cycles in which the compensation fades in or out
HYSTERETIC: Final = 21  # true if any joint has hysteresis
MEASURING: Final = 22  # true while the hysteresis state comes from the measured motion
COUNTS: Final = 23

WEIGHT: Final = 4  # word of `pace`: fraction of the compensation that is sent
PACE: Final = 5

CARRIED: Final = 0  # rows of `state`: x, latest torque, latest correction, work space
LATEST: Final = 1
ERROR: Final = 2
CHANGE: Final = 3
MOTOR_Q: Final = 4  # position and speed of the motors at the head, link side
MOTOR_V: Final = 5
FED: Final = 6  # speeds of the motors to send
STATE_ROWS: Final = 7

DRIVEN: Final = 0  # rows of `memory`: hysteresis states of the head's path, measured motion
MEASURED: Final = 1

WANTED: Final = 2  # rows of a place in `line`, after Q and V: motor speeds to send; node index
INDEX: Final = 3
OWN: Final = 4  # motors' speeds of the path
PLACE_ROWS: Final = 5

POINTS_A_CYCLE: Final = 4
DUST: Final = 1e-9  # rad or m per cycle: a smaller change is rounding, not motion

StageArrays: TypeAlias = tuple[
    FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray
]
"""State of the compensation.

`line` (places, PLACE_ROWS, n): rows that the head has passed and that have not been sent. `state`
(STATE_ROWS, n): inverse of the velocity loops. `memory` (2, n, STATE): hysteresis states. `found`
(n, FOUND): work space. `head` (3, n): the path's head. `out` (3, n): position, velocity and
feedforward to send.
"""


@kernel
def next_set_point(
    counters: IntArray,
    rows: FloatArray,
    model: ModelArrays,
    loads: LoadArrays,
    path: PathArrays,
    stage: StageArrays,
) -> bool:
    """Advance path and compensation by one cycle.

    Args:
        counters, rows, model, loads, path: As for `take_points`.
        stage: State of the compensation; `out` is written.

    Returns:
        True if the motion is over and `out` is its last set-point.
    """
    axes, nodes, _, counts, pace, _ = path
    line, state, memory, found, head, out = stage
    n, places = out.shape[1], line.shape[0]
    # a variable, because for a literal Numba would compile a second version of the function
    most = int(np.int64(POINTS_A_CYCLE))
    limited_before = counts[LIMITED]
    take_points(counters, rows, model, loads, path, most)
    torque = out[0]
    joints_by_motors, motors_by_joints = model[5][0], model[5][1]
    if counts[MEASURING]:
        _convert(motors_by_joints, head[Q], state[MOTOR_Q])
        set_load(model, loads, _time_on_path(path))
        _adopt_measured_state(
            model, axes[PRESLIDING : PRESLIDING + 2], memory, found, state, head, torque
        )
    known = advance(path, head) and counts[SIGNALLED] == 0
    _convert(motors_by_joints, head[Q], state[MOTOR_Q])
    _convert(motors_by_joints, head[V], state[MOTOR_V])
    h = counts[HEAD]
    if counts[RESTED] < 0 and counts[STATE] >= STOPPED:
        counts[RESTED] = h
    place = line[h % places]
    set_load(model, loads, _time_on_path(path))
    if counts[HYSTERETIC]:
        for j in range(n):
            if abs(state[MOTOR_Q, j] - memory[DRIVEN, j, LAST]) > DUST:
                counts[MEASURING] = 0
        update_presliding(state[MOTOR_Q], axes[PRESLIDING : PRESLIDING + 2], memory[DRIVEN], found)
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
        own = line[at % places, OWN, j]
        wanted = (1.0 - share) * now[WANTED, j] + share * then[WANTED, j]
        fed = own + pace[WEIGHT] * (wanted - own)
        state[FED, j] = min(max(fed, -axes[SPEED, j]), axes[SPEED, j])
    present = line[at % places]
    for j in range(n):
        out[0, j] = present[Q, j]
        out[1, j] = present[V, j]
        fed = 0.0
        for i in range(n):
            fed += joints_by_motors[j, i] * state[FED, i]
        fed = min(max(fed, -axes[SPEED, j]), axes[SPEED, j])
        # limit the change of speed whatever the model torque is: acceleration limit plus margin
        sent = min(max(fed, out[2, j] - axes[STEP, j]), out[2, j] + axes[STEP, j])
        limited = limited or sent != fed
        out[2, j] = sent
    if limited:
        counts[LIMITED] = limited_before + 1
    return bool(over)


@kernel
def _time_on_path(path: PathArrays) -> float:
    """Return the head's time on the path, as if it had always run at full rate [s]."""
    _, _, _, counts, pace, step_s = path
    offset = pace[OFFSET] if counts[STATE] == BRAKING else 0.0
    return float((counts[NODE] - BEFORE) * step_s + offset)


@kernel
def observe_position(
    position: FloatArray, axes: FloatArray, memory: FloatArray, found: FloatArray
) -> None:
    """Update the measured hysteresis during the approach and at the start.

    Args:
        position: Shape (n,). Measured positions of the motors, link side [rad or m].
        axes, memory, found: As in `PathArrays` and `StageArrays`.
    """
    update_presliding(position, axes[PRESLIDING : PRESLIDING + 2], memory[MEASURED], found)


@kernel
def _convert(matrix: FloatArray, values: FloatArray, out: FloatArray) -> None:
    """Write the product of a matrix (n, n) and values (n,) into `out`."""
    for i in range(len(values)):
        total = 0.0
        for j in range(len(values)):
            total += matrix[i, j] * values[j]
        out[i] = total


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
    """Use the measured hysteresis state at the head.

    Add the resulting change of torque to the integrators.

    The head's torques with the old and the new state are subtracted, so that torques without
    hysteresis cancel.
    """
    n = len(torque)
    update_presliding(state[MOTOR_Q], presliding, memory[DRIVEN], found)
    hysteretic_torque(model, head[0], head[1], head[2], found, torque)
    for j in range(n):
        state[CHANGE, j] = -torque[j]
        memory[DRIVEN, j] = memory[MEASURED, j]
        memory[DRIVEN, j, LAST] = state[MOTOR_Q, j]
    update_presliding(state[MOTOR_Q], presliding, memory[DRIVEN], found)
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
        speed = state[MOTOR_V, j]
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
        place[Q, j], place[V, j] = head[Q, j], head[V, j]
        place[OWN, j], place[WANTED, j] = speed, speed + bounded
    if limited:
        counts[LIMITED] += 1
    if doubt:
        counts[INVALID_TORQUES] += 1
    if large:
        counts[LARGE] += 1
    if doubt or large:
        counts[SUSPENDED_UNTIL] = counts[HEAD] + counts[HOLD]
