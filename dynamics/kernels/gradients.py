"""Gradients of weighted sums of regressor columns over the motion (reverse-mode differentiation).

The kernel passes along the chain in three ways:
1. From the base to the tool, it stores the motion of every link.
2. For each row and each weighted sum, it transforms the row's screw from the row's joint to the
   tool, and the derivatives with respect to the screw back to this joint. A screw is the unit
   motion that belongs to a row (`dynamics.kernels.rigid_body`).
3. From the tool to the base, it converts derivatives with respect to the links' motions to
   derivatives with respect to the joints' motions.

In this module, the gain of a quantity is the derivative of the weighted sum with respect to that
quantity.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from config.arrays import BoolArray, FloatArray
from dynamics.geometry.kinematics import ChainArrays
from dynamics.kernels.rigid_body import RotorArrays
from dynamics.kernels.simd import (
    LANES,
    Lanes,
    Samples,
    gather,
    kernel,
    load,
    scatter,
    spread,
    store,
)
from dynamics.kernels.vectors import (
    Rotation,
    Vector,
    accumulate,
    add,
    angular_motion,
    cross,
    dot,
    eight_indices,
    joint_frame,
    load_vector,
    scale,
    store_vector,
    turn,
    turn_back,
    unit_vector,
    zero_vector,
)

Pair: TypeAlias = tuple[FloatArray, FloatArray]
"""A pair of arrays for the two kinds of columns: for links (or joints), and for rotors (or
actuators).
"""

Rotor: TypeAlias = tuple[Vector, float, int]
"""A rotor: its axis in the frame of the link that carries it, its ratio, and the index of the joint
that it drives."""

Sweep: TypeAlias = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]
"""Intermediate results of the passes along the chain, for eight samples.

`moves` (3 (n + 1), 3, LANES): angular velocity, angular acceleration, and acceleration of the
frame's origin, for the base and then for every link. `gains`, with the same shape: the derivatives
of the weighted sum by `moves`. `frames` (4 n, 3, LANES): rotation and offset of every joint.
`screws` (2 n, 3, LANES): the two vectors of a row's screw on every link. `by_position` (n, 1,
LANES): the derivative of the sum by each joint position.
"""


def weights_of(values: FloatArray) -> FloatArray:
    """Return a read-only view; numba would compile a second version for writable arrays."""
    weights = values.view()
    weights.setflags(write=False)
    return weights


@kernel
def pull_back(
    chain: ChainArrays,
    rotors: RotorArrays,
    moved: Pair,
    first_link: int,
    weights: Pair,
    found: Pair,
    first: int,
    last: int,
) -> None:
    """Compute the derivatives of weighted sums of the links' and rotors' columns by the motion.

    Args:
        chain, rotors: As for `fill_rotors`.
        moved: Two (3, samples, n) arrays. Positions, velocities, accelerations of the joints and of
            the actuators.
        first_link: The first link (from 0) that has weights; n if no link has weights.
        weights: Two arrays, (sums, samples, n, 10 (n - first_link)) and (sums, samples, n, rotors).
            Weights of the columns of `fill_rigid_body` and of `fill_rotors`, with one row per
            joint.
        found: Two (sums, 3, samples, n) arrays. Output, zero on entry: the derivatives of each sum
            by the motion of the joints and, if there are rotors, by that of the actuators.
        first, last: Range of samples to compute.
    """
    motion, actuator = moved
    link_weights, rotor_weights = weights
    by_joint, by_actuator = found
    prismatic, rotor_link = chain[2], rotors[1]
    joints = motion.shape[2]
    moves = np.zeros((3 * (joints + 1), 3, LANES))
    gains = np.zeros((3 * (joints + 1), 3, LANES))
    frames = np.empty((4 * joints, 3, LANES))
    screws = np.empty((2 * joints, 3, LANES))
    by_position = np.empty((joints, 1, LANES))
    sweep = (moves, gains, frames, screws, by_position)
    for start in range(first, last, LANES):
        samples = eight_indices(start, last)
        _sweep_out(chain, motion, samples, moves, frames)
        for one in range(len(by_joint)):
            gains[:] = 0.0
            by_position[:] = 0.0
            for k in range(joints):
                _carry_screw(prismatic, k, frames, screws)
                turning_gain = sliding_gain = zero_vector()
                for i in range(joints - 1, k - 1, -1):
                    if i >= first_link:
                        of_link = link_weights[one, :, k, 10 * (i - first_link) :]
                        a, b = _contract_link(of_link, samples, i, screws, moves, gains)
                        turning_gain, sliding_gain = add(turning_gain, a), add(sliding_gain, b)
                    for r in range(len(rotor_link)):
                        if rotor_link[r] == i + 1:
                            weight = gather(rotor_weights[one, :, k], samples, r)
                            a = _contract_rotor(
                                weight,
                                _rotor(rotors, r),
                                actuator,
                                samples,
                                i,
                                sweep,
                                by_actuator[one],
                            )
                            turning_gain = add(turning_gain, a)
                    if i > k:
                        turning_gain, sliding_gain = _carry_back(
                            chain, i, turning_gain, sliding_gain, sweep
                        )
            for r in range(len(rotor_link)):
                _contract_own(rotor_weights[one], rotors, r, samples, gains, by_actuator[one])
            _sweep_in(chain, motion, samples, sweep, by_joint[one])


@kernel
def _sweep_out(
    chain: ChainArrays,
    motion: FloatArray,
    samples: Samples,
    moves: FloatArray,
    frames: FloatArray,
) -> None:
    """Compute the motion of every link and the frame of every joint, from the base to the tool."""
    rows, fixed_rotations, prismatic, gravity = chain
    w = dw = zero_vector()
    dv = (w[0] - gravity[0], w[1] - gravity[1], w[2] - gravity[2])
    store_vector(dv, moves, 2)
    for i in range(motion.shape[2]):
        q, qd = gather(motion[0], samples, i), gather(motion[1], samples, i)
        qdd = gather(motion[2], samples, i)
        rotation, offset = joint_frame(rows[i], fixed_rotations[i], prismatic[i], q)
        centripetal = cross(w, cross(w, offset))
        dv = turn(rotation, add(dv, add(cross(dw, offset), centripetal)))
        w, dw = angular_motion(rotation, w, dw, prismatic[i], qd, qdd)
        if prismatic[i]:
            dv = (dv[0] + 2.0 * w[1] * qd, dv[1] - 2.0 * w[0] * qd, dv[2] + qdd)
        store_vector(w, moves, 3 * i + 3)
        store_vector(dw, moves, 3 * i + 4)
        store_vector(dv, moves, 3 * i + 5)
        for column in range(3):
            store_vector(rotation[column], frames, 4 * i + column)
        store_vector(offset, frames, 4 * i + 3)


@kernel
def _carry_screw(prismatic: BoolArray, k: int, frames: FloatArray, screws: FloatArray) -> None:
    """Compute the screw of joint k in the frames of its link and all following links."""
    turning = unit_vector(3 if prismatic[k] else 2)
    sliding = unit_vector(2 if prismatic[k] else 3)
    store_vector(turning, screws, 2 * k)
    store_vector(sliding, screws, 2 * k + 1)
    for i in range(k + 1, len(prismatic)):
        rotation, offset = _frame(frames, i)
        sliding = turn(rotation, add(sliding, cross(turning, offset)))
        turning = turn(rotation, turning)
        store_vector(turning, screws, 2 * i)
        store_vector(sliding, screws, 2 * i + 1)


@kernel
def _contract_link(
    weights: FloatArray,
    samples: Samples,
    i: int,
    screws: FloatArray,
    moves: FloatArray,
    gains: FloatArray,
) -> tuple[Vector, Vector]:
    """Add the contribution of link i's ten weights to `gains`; return the gains of the screw.

    The calculation treats the weights as the inertial parameters of a body. The gains of the
    screw's angular and linear vectors are then the moment and the force on this body.
    """
    m = gather(weights, samples, 0)
    h = (gather(weights, samples, 1), gather(weights, samples, 2), gather(weights, samples, 3))
    xx, xy = gather(weights, samples, 4), gather(weights, samples, 5)
    xz, yy = gather(weights, samples, 6), gather(weights, samples, 7)
    yz, zz = gather(weights, samples, 8), gather(weights, samples, 9)
    inertia = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    t, s = load_vector(screws, 2 * i), load_vector(screws, 2 * i + 1)
    w, dw = load_vector(moves, 3 * i + 3), load_vector(moves, 3 * i + 4)
    dv = load_vector(moves, 3 * i + 5)
    momentum = turn(inertia, w)
    force = add(scale(m, dv), add(cross(dw, h), cross(w, cross(w, h))))
    moment = add(cross(h, dv), add(turn(inertia, dw), cross(w, momentum)))
    by_w = add(cross(momentum, t), turn(inertia, cross(t, w)))
    accumulate(add(by_w, _centripetal_derivative(s, w, h)), gains, 3 * i + 3)
    accumulate(add(cross(h, s), turn(inertia, t)), gains, 3 * i + 4)
    accumulate(add(scale(m, s), cross(t, h)), gains, 3 * i + 5)
    return moment, force


@kernel
def _contract_rotor(
    weight: Lanes,
    rotor: Rotor,
    actuator: FloatArray,
    samples: Samples,
    i: int,
    sweep: Sweep,
    by_actuator: FloatArray,
) -> Vector:
    """Add a rotor's load on link i to the gains; return the gain of the screw's angular part."""
    axis, ratio, joint = rotor
    moves, gains, _, screws, _ = sweep
    t, w = load_vector(screws, 2 * i), load_vector(moves, 3 * i + 3)
    weight = ratio * weight
    spin, spin_up = gather(actuator[1], samples, joint), gather(actuator[2], samples, joint)
    gyration = cross(w, axis)
    accumulate(scale(weight * spin, cross(axis, t)), gains, 3 * i + 3)
    _add(weight * dot(t, gyration), by_actuator[1], samples, joint)
    _add(weight * dot(t, axis), by_actuator[2], samples, joint)
    return scale(weight, add(scale(spin_up, axis), scale(spin, gyration)))


@kernel
def _contract_own(
    weights: FloatArray,
    rotors: RotorArrays,
    r: int,
    samples: Samples,
    gains: FloatArray,
    by_actuator: FloatArray,
) -> None:
    """Add the contribution of a rotor's torque on its own actuator to the gains."""
    _, rotor_link, _, _, own_torque = rotors
    axis, ratio, joint = _rotor(rotors, r)
    weight = spread(0.0)
    for k in range(own_torque.shape[0]):
        weight = weight + own_torque[k, joint] * gather(weights[:, k], samples, r)
    weight = ratio * weight
    accumulate(scale(weight, axis), gains, 3 * rotor_link[r] + 1)
    _add(ratio * weight, by_actuator[2], samples, joint)


@kernel
def _carry_back(
    chain: ChainArrays,
    i: int,
    turning_gain: Vector,
    sliding_gain: Vector,
    sweep: Sweep,
) -> tuple[Vector, Vector]:
    """Transform the gains of a screw from the frame of link i to that of the previous link."""
    _, fixed_rotations, prismatic, _ = chain
    _, _, frames, screws, by_position = sweep
    rotation, offset = _frame(frames, i)
    force = turn_back(rotation, sliding_gain)
    if prismatic[i]:
        before = load_vector(screws, 2 * i - 2)
        gain = _axis_component(fixed_rotations[i], cross(force, before))
    else:
        turning, sliding = load_vector(screws, 2 * i), load_vector(screws, 2 * i + 1)
        gain = _rotation_derivative(turning_gain, turning) + _rotation_derivative(
            sliding_gain, sliding
        )
    store(load(by_position, i, 0) + gain, by_position, i, 0)
    return add(turn_back(rotation, turning_gain), cross(offset, force)), force


@kernel
def _sweep_in(
    chain: ChainArrays, motion: FloatArray, samples: Samples, sweep: Sweep, by_joint: FloatArray
) -> None:
    """Convert the gains of the links' motions to those of the joints' motions."""
    _, fixed_rotations, prismatic, _ = chain
    moves, gains, frames, _, by_position = sweep
    for i in range(len(prismatic) - 1, -1, -1):
        rotation, offset = _frame(frames, i)
        qd = gather(motion[1], samples, i)
        w, dw = load_vector(moves, 3 * i + 3), load_vector(moves, 3 * i + 4)
        dv = load_vector(moves, 3 * i + 5)
        by_w, by_dw = load_vector(gains, 3 * i + 3), load_vector(gains, 3 * i + 4)
        by_dv = load_vector(gains, 3 * i + 5)
        gain = load(by_position, i, 0)
        if prismatic[i]:
            scatter(2.0 * _rotation_derivative(by_dv, w), by_joint[1], samples, i)
            scatter(by_dv[2], by_joint[2], samples, i)
            by_w = (by_w[0] - 2.0 * qd * by_dv[1], by_w[1] + 2.0 * qd * by_dv[0], by_w[2])
        else:
            scatter(by_w[2] + _rotation_derivative(by_dw, w), by_joint[1], samples, i)
            scatter(by_dw[2], by_joint[2], samples, i)
            by_w = (by_w[0] - qd * by_dw[1], by_w[1] + qd * by_dw[0], by_w[2])
            turned = (dw[0] - w[1] * qd, dw[1] + w[0] * qd, dw[2])
            gain = (
                gain
                + _rotation_derivative(by_dv, dv)
                + _rotation_derivative(by_w, w)
                + _rotation_derivative(by_dw, turned)
            )
        force = turn_back(rotation, by_dv)
        w, dw = load_vector(moves, 3 * i), load_vector(moves, 3 * i + 1)
        if prismatic[i]:
            by_offset = add(cross(force, dw), cross(w, cross(w, force)))
            gain = gain + _axis_component(fixed_rotations[i], by_offset)
        by_w = add(turn_back(rotation, by_w), _centripetal_derivative(force, w, offset))
        accumulate(by_w, gains, 3 * i)
        accumulate(add(turn_back(rotation, by_dw), cross(offset, force)), gains, 3 * i + 1)
        accumulate(force, gains, 3 * i + 2)
        scatter(gain, by_joint[0], samples, i)


@kernel
def _frame(frames: FloatArray, i: int) -> tuple[Rotation, Vector]:
    rotation = (
        load_vector(frames, 4 * i),
        load_vector(frames, 4 * i + 1),
        load_vector(frames, 4 * i + 2),
    )
    return rotation, load_vector(frames, 4 * i + 3)


@kernel
def _centripetal_derivative(s: Vector, w: Vector, p: Vector) -> Vector:
    """Return the derivative of s . (w x (w x p)) with respect to w."""
    along = add(scale(dot(w, p), s), scale(dot(s, w), p))
    return add(along, scale(-2.0 * dot(s, p), w))


@kernel
def _rotation_derivative(gain: Vector, v: Vector) -> Lanes:
    """Return the derivative with respect to the angle about z of the frame of vector v."""
    return gain[0] * v[1] - gain[1] * v[0]


@kernel
def _axis_component(fixed: FloatArray, v: Vector) -> Lanes:
    """Return the component of v along a joint's axis; v is in the frame of the previous link."""
    along: Lanes = v[0] * fixed[0, 2] + v[1] * fixed[1, 2] + v[2] * fixed[2, 2]
    return along


@kernel
def _rotor(rotors: RotorArrays, r: int) -> Rotor:
    joint, _, axis, ratio, _ = rotors
    across = (spread(axis[r, 0]), spread(axis[r, 1]), spread(axis[r, 2]))
    return across, ratio[r], joint[r]


@kernel
def _add(x: Lanes, array: FloatArray, samples: Samples, column: int) -> None:
    scatter(gather(array, samples, column) + x, array, samples, column)
