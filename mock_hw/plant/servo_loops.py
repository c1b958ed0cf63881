"""Kernel that simulates servo loops, friction and motion of all axes in steps below 1 ms.

The coordinate of an axis is that of its motor, divided by the gear ratio. It is equal to the joint
coordinate, except in coupled wrists and with elastic gears. The kernel contains the velocity PI
loop with a first-order current loop, Coulomb friction with sticking, viscous friction, gravity
spring, brakes, cogging, tachometer ripple, and the anti-alias filter of the torque measurement.
Mass matrix and bias of the rigid bodies are constant during a call; the caller updates them between
calls. The outputs of elastic gears are separate coordinates after those of all axes. Between motor
and output there are the spring, the damper and the play of the gear.

A step h is an implicit midpoint step for all effects except Coulomb friction. Without this
friction, the velocity v⁺ after the step would satisfy the linear equations A v⁺ = r. Coulomb
friction is set-valued: at rest it can have any value in [-f_C, f_C]. Therefore v⁺ minimises
½ v⁺ᵀAv⁺ - rᵀv⁺ + h f_Cᵀ|v⁺|, which has a unique solution for any step. An axis that sticks has
exactly v⁺ = 0.

Friction with presliding is not set-valued. It is the elasto-plastic bristle model of Dupont,
Hayward, Armstrong and Altpeter (IEEE Transactions on Automatic Control 47(5), 2002). A bristle has
stiffness sigma_0, damping sigma_1 and stretch z; its force is sigma_0 z + sigma_1 dz/dt. At a
velocity v, the stretch follows dz/dt = v (1 - alpha z sign(v) / z_ss), where z_ss is the stretch of
steady sliding. While the stretch grows, alpha rises from 0 at 0.7 z_ss to 1 at z_ss; while it
decreases, alpha is 0. Coulomb, Stribeck and load-dependent friction together are sigma_0 z_ss. The
friction of the brake is always set-valued.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from config.arrays import IntArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

# Rows of `state`; there is one column per axis.
POSITION = 0
VELOCITY = 1
ACCELERATION = 2
INTEGRAL = 3  # integral of the velocity error [rad]
TORQUE = 4  # motor torque, link side
BRISTLE = 5  # z, stretch of the bristle [rad]
STATE_ROWS = 6

# Rows of `axes`: parameters; there is one column per axis.
COULOMB = 0
VISCOUS = 1
GAIN = 2
INTEGRAL_TIME = 3
CURRENT_BANDWIDTH = 4  # [rad/s]
BRAKE = 5
STRIBECK = 6
STRIBECK_VELOCITY = 7
LOAD_FRICTION = 8
COGGING = 9
COGGING_WAVES = 10  # periods per joint revolution
RIPPLE = 11
RIPPLE_WAVES = 12
FRICTION_DRIFT = 13  # [1/s]
BRISTLE_STIFFNESS = 14  # sigma_0; 0: no presliding
OUTPUT = 15  # column of the gear's output; of the motor if the gear is rigid
GEAR_STIFFNESS = 16
GEAR_DAMPING = 17
PLAY = 18  # from one tooth flank to the other
AXES_ROWS = 19

# Rows of `command`: commands for one call; there is one column per axis.
COMMAND_START = 0
COMMAND_SLOPE = 1
POWERED = 2
BRAKED = 3
TORQUE_LIMIT = 4
COMMAND_ROWS = 5

# Entries of `spring`: column (-1: no spring), stiffness k, free length, lever arms l and r.

_SWEEPS = 60
_ELASTIC_FRACTION = 0.7
"""Fraction of z_ss up to which a bristle is purely elastic."""
_BRISTLE_DAMPING_S = 0.0002
"""Ratio sigma_1 / sigma_0 [s]; it damps oscillations of an axis that a bristle holds at rest."""
_NEGLIGIBLE_TORQUE = 1e-12


@njit(cache=True)
def reduce_to_actuators(
    full_mass: Array,
    full_bias: Array,
    coordinate: IntArray,
    actuator: IntArray,
    value: Array,
    mass: Array,
    bias: Array,
) -> None:
    """Compute the reduced equations: Gᵀ M G into `mass`, (n, n), and Gᵀ b into `bias`, (n,).

    `full_mass` is M, `full_bias` is b; `coordinate`, `actuator` and `value` are row, column and
    value of the nonzero entries of G.
    """
    mass[:] = 0.0
    bias[:] = 0.0
    count = len(coordinate)
    for first in range(count):
        row, i = coordinate[first], actuator[first]
        bias[i] += value[first] * full_bias[row]
        for second in range(count):
            factor = value[first] * value[second]
            mass[i, actuator[second]] += factor * full_mass[row, coordinate[second]]


@njit(cache=True)
def spring_torque(spring: Array, position: float) -> float:
    """Return the torque that holds the joint against the gravity spring (3.36) [N m]."""
    stiffness, free_length, l_m, r_m = spring[1], spring[2], spring[3], spring[4]
    squared = l_m * l_m + r_m * r_m - 2.0 * l_m * r_m * math.cos(position)
    length = math.sqrt(squared)
    return float(stiffness * (length - free_length) * l_m * r_m * math.sin(position) / length)


class Inertia(NamedTuple):
    """Dynamics of the rigid bodies, in the coordinates of motors and gear outputs.

    Attributes:
        mass: Shape (m, m). Mass matrix; the coordinates are the n motors, then the outputs of
            elastic gears.
        bias: Shape (m,). Coriolis, centrifugal and gravity torques.
    """

    mass: Array
    bias: Array


class Actuators(NamedTuple):
    """Parameters and commands of the axes.

    Attributes:
        axes: Shape (AXES_ROWS, n). Parameters of the axes; constants such as `COULOMB` name the
            rows.
        command: Shape (COMMAND_ROWS, n). Commands; constants such as `POWERED` name the rows.
        spring: Shape (5,). The gravity spring, as `spring_torque` uses it.
    """

    axes: Array
    command: Array
    spring: Array


class TorqueFilter(NamedTuple):
    """The anti-alias filter of the torque measurement.

    Attributes:
        gains: Shape (3, poles). For each pole p: exp(p h) for a step h, and the weights of the
            torque at the beginning and at the end of the step.
        state: Shape (poles, n). State of the filter; overwritten.
    """

    gains: ComplexArray
    state: ComplexArray


@njit(cache=True)
def advance_servo_loops(
    steps: int,
    step_s: float,
    start_s: float,
    since_command_s: float,
    inertia: Inertia,
    actuators: Actuators,
    state: Array,
    torque_filter: TorqueFilter,
) -> None:
    """Advance the state of all axes by `steps` steps of `step_s`, in place.

    Args:
        steps: Number of steps.
        step_s: Duration of one step [s].
        start_s: Time since the start of the plant [s].
        since_command_s: Time since the start of the present command [s].
        inertia: Rigid-body dynamics, constant for all steps.
        actuators: Parameters and commands of the axes.
        state: Shape (STATE_ROWS, m). Constants such as `POSITION` name the rows; of the outputs of
            elastic gears, only position, velocity and acceleration are used.
        torque_filter: Filter of the measured torques.
    """
    mass, bias = inertia
    axes, command, spring = actuators
    filter_gains, filter_state = torque_filter
    count = axes.shape[1]
    coordinates = state.shape[1]
    system = np.empty((coordinates, coordinates))
    momentum = np.empty(coordinates)
    held = np.zeros(coordinates)
    solved = np.empty(coordinates)
    before = np.empty(count)
    ripple = np.empty(count)
    saturated = np.empty(count)
    yielding = np.zeros(count)
    half = 0.5 * step_s
    for step in range(steps):
        middle_s = since_command_s + (step + 0.5) * step_s
        drifted_s = start_s + (step + 0.5) * step_s
        for i in range(count):
            position = state[POSITION, i] + half * state[VELOCITY, i]
            velocity = state[VELOCITY, i] + half * state[ACCELERATION, i]
            wanted = command[COMMAND_START, i] + command[COMMAND_SLOPE, i] * middle_s
            ripple[i] = 1.0 + axes[RIPPLE, i] * math.cos(axes[RIPPLE_WAVES, i] * position)

            # Velocity PI loop with the torque limit, then the exact response of the current loop.
            before[i] = state[TORQUE, i]
            target = 0.0
            saturated[i] = 0.0
            if command[POWERED, i] > 0.0:
                error = wanted - velocity * ripple[i]
                integral = state[INTEGRAL, i] + half * error
                target = axes[GAIN, i] * (error + integral / axes[INTEGRAL_TIME, i])
                limit = command[TORQUE_LIMIT, i]
                if abs(target) > limit:
                    target = math.copysign(limit, target)
                    saturated[i] = target
            lag = axes[CURRENT_BANDWIDTH, i] * step_s
            remaining = (before[i] - target) * math.exp(-lag)
            mean_torque = target + (before[i] - target) * (-math.expm1(-lag)) / lag
            if abs(remaining) < _NEGLIGIBLE_TORQUE:
                remaining = 0.0
            state[TORQUE, i] = target + remaining

            load = mean_torque - bias[i]
            if spring[0] == i:
                load -= spring_torque(spring, position)
            if axes[COGGING, i] > 0.0:
                load -= axes[COGGING, i] * math.sin(axes[COGGING_WAVES, i] * position)

            warmth = max(0.0, 1.0 + axes[FRICTION_DRIFT, i] * drifted_s)
            friction = axes[COULOMB, i]
            if axes[STRIBECK, i] > 0.0:
                friction += axes[STRIBECK, i] * math.exp(
                    -abs(velocity) / axes[STRIBECK_VELOCITY, i]
                )
            friction += axes[LOAD_FRICTION, i] * abs(mean_torque)
            friction *= warmth
            viscous = warmth * axes[VISCOUS, i]
            if axes[BRISTLE_STIFFNESS, i] > 0.0:
                stretch = state[BRISTLE, i]
                yielding[i] = bristle_yield(
                    velocity, stretch, friction / axes[BRISTLE_STIFFNESS, i], step_s
                )
                resting, dragged = bristle_force(axes[BRISTLE_STIFFNESS, i], yielding[i], step_s)
                load -= resting * stretch
                viscous += dragged
                friction = 0.0
            if command[BRAKED, i] > 0.0:
                friction += axes[BRAKE, i]

            held[i] = step_s * friction
            momentum[i] = step_s * (load - 0.5 * viscous * state[VELOCITY, i])
            for j in range(coordinates):
                momentum[i] += mass[i, j] * state[VELOCITY, j]
                system[i, j] = mass[i, j]
            system[i, i] += half * viscous
            solved[i] = state[VELOCITY, i] + step_s * state[ACCELERATION, i]

        for i in range(count, coordinates):
            load = -bias[i]
            if spring[0] == i:
                load -= spring_torque(spring, state[POSITION, i] + half * state[VELOCITY, i])
            momentum[i] = step_s * load
            for j in range(coordinates):
                momentum[i] += mass[i, j] * state[VELOCITY, j]
                system[i, j] = mass[i, j]
            solved[i] = state[VELOCITY, i] + step_s * state[ACCELERATION, i]
        if coordinates > count:
            join_gears(axes, state, step_s, system, momentum)

        solve_with_friction(system, momentum, held, solved)

        for i in range(coordinates):
            mean_velocity = 0.5 * (state[VELOCITY, i] + solved[i])
            state[ACCELERATION, i] = (solved[i] - state[VELOCITY, i]) / step_s
            state[VELOCITY, i] = solved[i]
            state[POSITION, i] += step_s * mean_velocity
            if i >= count:
                continue
            if axes[BRISTLE_STIFFNESS, i] > 0.0:
                lost = half * yielding[i]
                state[BRISTLE, i] = (state[BRISTLE, i] * (1.0 - lost) + step_s * mean_velocity) / (
                    1.0 + lost
                )
            if command[POWERED, i] > 0.0:
                wanted = command[COMMAND_START, i] + command[COMMAND_SLOPE, i] * middle_s
                error = wanted - mean_velocity * ripple[i]
                if saturated[i] * error <= 0.0:  # anti-windup
                    state[INTEGRAL, i] += step_s * error
            else:
                state[INTEGRAL, i] = 0.0
            for pole in range(filter_gains.shape[1]):
                filter_state[pole, i] = (
                    filter_gains[0, pole] * filter_state[pole, i]
                    + filter_gains[1, pole] * before[i]
                    + filter_gains[2, pole] * state[TORQUE, i]
                )


@njit(cache=True)
def bristle_yield(velocity: float, stretch: float, limit: float, step_s: float) -> float:
    """Return the yield rate of a bristle: `rate` in dz/dt = v - rate z [1/s].

    Args:
        velocity: Present velocity v.
        stretch: Present stretch z.
        limit: z_ss, the largest stretch.
        step_s: Duration of a step [s]. If the limit is 0, the stretch returns to 0 within some
            steps.
    """
    if velocity * stretch <= 0.0:
        return 0.0
    if limit <= 0.0:
        return 1.0 / step_s
    relative = abs(stretch) / limit
    if relative <= _ELASTIC_FRACTION:
        return 0.0
    alpha = 1.0
    if relative < 1.0:
        middle = 0.5 * (1.0 + _ELASTIC_FRACTION)
        alpha = 0.5 + 0.5 * math.sin(math.pi * (relative - middle) / (1.0 - _ELASTIC_FRACTION))
    return alpha * abs(velocity) / limit


@njit(cache=True)
def bristle_force(stiffness: float, rate: float, step_s: float) -> tuple[float, float]:
    """Return the factors of z and of v in a bristle's mean force during a step.

    z is the stretch before the step h, v the mean velocity. With dz/dt = v - rate z in the middle
    of the step, the stretch afterwards is z⁺ = (z (1 - h rate/2) + h v) / (1 + h rate/2).
    """
    gone = 1.0 + 0.5 * step_s * rate
    damping = _BRISTLE_DAMPING_S * stiffness
    return (stiffness - damping * rate) / gone, (0.5 * step_s * stiffness + damping) / gone


@njit(cache=True)
def join_gears(axes: Array, state: Array, step_s: float, system: Array, momentum: Array) -> None:
    """Add the springs, dampers and play of elastic gears to `system` and `momentum`, in place."""
    for i in range(axes.shape[1]):
        out = int(axes[OUTPUT, i])
        if out == i:
            continue
        turned = state[POSITION, i] - state[POSITION, out]
        turning = state[VELOCITY, i] - state[VELOCITY, out]
        speeding = state[ACCELERATION, i] - state[ACCELERATION, out]
        ahead = turned + 0.5 * step_s * (turning + 0.5 * step_s * speeding)
        free = 0.5 * axes[PLAY, i]
        if abs(ahead) <= free and free > 0.0:
            continue
        flank = math.copysign(free, ahead)
        stiffness, damping = axes[GEAR_STIFFNESS, i], axes[GEAR_DAMPING, i]
        known = stiffness * (turned - flank + 0.25 * step_s * turning) + 0.5 * damping * turning
        per_turning = step_s * (0.25 * step_s * stiffness + 0.5 * damping)
        momentum[i] -= step_s * known
        momentum[out] += step_s * known
        system[i, i] += per_turning
        system[out, out] += per_turning
        system[i, out] -= per_turning
        system[out, i] -= per_turning


@njit(cache=True)
def solve_with_friction(system: Array, momentum: Array, held: Array, solved: Array) -> None:
    """Compute the velocities after a step with Coulomb friction; `solved` is guess and result.

    The velocities v satisfy system v = momentum - friction. The friction of a moving coordinate is
    `held`, against the motion; that of a resting coordinate keeps it at rest and is at most `held`.
    Such v minimise ½ vᵀAv - rᵀv + fᵀ|v| with A `system`, r `momentum` and f `held`, here by
    coordinate descent.
    """
    count = len(solved)
    for _ in range(_SWEEPS):
        change = 0.0
        size = 0.0
        for i in range(count):
            free = momentum[i]
            for j in range(count):
                if j != i:
                    free -= system[i, j] * solved[j]
            excess = abs(free) - held[i]
            value = math.copysign(excess, free) / system[i, i] if excess > 0.0 else 0.0
            change = max(change, abs(value - solved[i]))
            size = max(size, abs(value))
            solved[i] = value
        if change <= 1e-14 * size:
            return
