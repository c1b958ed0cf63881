"""What happens in every axis within a fraction of a millisecond, as one compiled kernel.

An axis is an actuator at its gear's output: the joint itself, but for coupled wrists.
Velocity PI loop with a first-order current loop, Coulomb friction that sticks, viscous friction,
gravity spring, brakes, cogging, tachometer ripple, and the anti-alias filter behind the torque
converter. The rigid bodies' mass matrix and bias are constants here: the caller renews them.

A step is an implicit midpoint step in everything but Coulomb friction, which takes part as the set
[-f_C, f_C]: v⁺ minimises ½ v⁺ᵀAv⁺ - rᵀv⁺ + h f_Cᵀ|v⁺|, which has one solution for any step. An axis
whose friction holds it has v⁺ = 0 exactly.
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

# Rows of `state`, one column an axis.
POSITION = 0
VELOCITY = 1
ACCELERATION = 2
INTEGRAL = 3  # of the velocity error [rad]
TORQUE = 4  # of the motor, link side
STATE_ROWS = 5

# Rows of `axes`: what an axis is.
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
COGGING_WAVES = 10  # periods per joint turn
RIPPLE = 11
RIPPLE_WAVES = 12
FRICTION_DRIFT = 13  # [1/s]
AXES_ROWS = 14

# Rows of `command`: what an axis is told for the time of one call.
COMMAND_START = 0
COMMAND_SLOPE = 1
POWERED = 2
BRAKED = 3
TORQUE_LIMIT = 4
COMMAND_ROWS = 5

# Entries of `spring`: joint (-1: none), stiffness k, free length, lever arms l and r.

_SWEEPS = 60
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
    """Write Gᵀ M G (n, n) into `mass` and Gᵀ b (n,) into `bias`; M and b are the full model's.

    G is given by its entries that are not 0.
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
    """Torque that holds the joint against the gravity spring (3.36) [N m]."""
    stiffness, free_length, l_m, r_m = spring[1], spring[2], spring[3], spring[4]
    squared = l_m * l_m + r_m * r_m - 2.0 * l_m * r_m * math.cos(position)
    length = math.sqrt(squared)
    return float(stiffness * (length - free_length) * l_m * r_m * math.sin(position) / length)


class Inertia(NamedTuple):
    """The rigid bodies at the actuators.

    Attributes
    ----------
    mass : ndarray, shape (n, n)
        Mass matrix.
    bias : ndarray, shape (n,)
        Coriolis, centrifugal and gravity torques.
    """

    mass: Array
    bias: Array


class Actuators(NamedTuple):
    """What the axes are and what they are told.

    Attributes
    ----------
    axes, command : ndarray, shape (AXES_ROWS, n) and (COMMAND_ROWS, n)
        Rows as named above.
    spring : ndarray, shape (5,)
        The gravity spring.
    """

    axes: Array
    command: Array
    spring: Array


class TorqueFilter(NamedTuple):
    """The filter behind the torque converter.

    Attributes
    ----------
    gains : ndarray, shape (3, poles)
        Per pole: exp(p h), and the weights of the torque at a step's beginning and end.
    state : ndarray, shape (poles, n)
        Changed in place.
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
    """Advance all axes by `steps` steps of `step_s`, in place.

    Parameters
    ----------
    steps, step_s : int, float
        How many steps, and how long one is [s].
    start_s, since_command_s : float
        Time since the plant began, and since the command began to hold [s].
    inertia : Inertia
        Held for all steps.
    actuators : Actuators
        What the axes are and what they are told.
    state : ndarray, shape (STATE_ROWS, n)
        Rows as named above.
    torque_filter : TorqueFilter
        What the torques are measured through.
    """
    mass, bias = inertia
    axes, command, spring = actuators
    filter_gains, filter_state = torque_filter
    count = state.shape[1]
    system = np.empty((count, count))
    momentum = np.empty(count)
    held = np.empty(count)
    solved = np.empty(count)
    before = np.empty(count)
    ripple = np.empty(count)
    saturated = np.empty(count)
    half = 0.5 * step_s
    for step in range(steps):
        middle_s = since_command_s + (step + 0.5) * step_s
        drifted_s = start_s + (step + 0.5) * step_s
        for i in range(count):
            position = state[POSITION, i] + half * state[VELOCITY, i]
            velocity = state[VELOCITY, i] + half * state[ACCELERATION, i]
            wanted = command[COMMAND_START, i] + command[COMMAND_SLOPE, i] * middle_s
            ripple[i] = 1.0 + axes[RIPPLE, i] * math.cos(axes[RIPPLE_WAVES, i] * position)

            # Velocity PI loop, held at the torque limit, then the current loop's exact lag.
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
            if command[BRAKED, i] > 0.0:
                friction += axes[BRAKE, i]
            viscous = warmth * axes[VISCOUS, i]

            held[i] = step_s * friction
            momentum[i] = step_s * (load - 0.5 * viscous * state[VELOCITY, i])
            for j in range(count):
                momentum[i] += mass[i, j] * state[VELOCITY, j]
                system[i, j] = mass[i, j]
            system[i, i] += half * viscous
            solved[i] = state[VELOCITY, i] + step_s * state[ACCELERATION, i]

        solve_with_friction(system, momentum, held, solved)

        for i in range(count):
            mean_velocity = 0.5 * (state[VELOCITY, i] + solved[i])
            state[ACCELERATION, i] = (solved[i] - state[VELOCITY, i]) / step_s
            state[VELOCITY, i] = solved[i]
            state[POSITION, i] += step_s * mean_velocity
            if command[POWERED, i] > 0.0:
                wanted = command[COMMAND_START, i] + command[COMMAND_SLOPE, i] * middle_s
                error = wanted - mean_velocity * ripple[i]
                if saturated[i] * error <= 0.0:  # an integrator at its limit only winds down
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
def solve_with_friction(system: Array, momentum: Array, held: Array, solved: Array) -> None:
    """Minimise ½ vᵀAv - rᵀv + fᵀ|v| by coordinate descent, from the guess in `solved`, in place."""
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
