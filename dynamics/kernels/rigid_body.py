"""Compiled recursions along the chain that compute the regressor's columns of links and rotors.

There is one recursion for the links and one for the rotors. Each goes from the base to the last
link and computes, in the frame of each link, the link's motion and the *screws*. Each row of the
regressor has a screw, the unit motion that belongs to it: a motion of one joint for the torque of
this joint, or a motion of the base for one component of the base wrench. The contribution of a
link's load to a row is the virtual power of this load for the row's screw. The method is the
modified recursive Newton-Euler method (appendix B of the thesis), with the backward recursion
replaced by its transpose.

A call computes the samples `first` to `last` - 1, eight at a time. Numba's cache on disk detects
only changes in a kernel's own file: after a change of `simd.py` or `vectors.py`, touch the files of
the kernels that use them.
"""

from __future__ import annotations

import numpy as np

from config.arrays import FloatArray, IntArray
from dynamics.geometry.kinematics import ChainArrays
from dynamics.kernels.simd import LANES, gather, kernel, scatter, store, store_transposed
from dynamics.kernels.vectors import (
    Vector,
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
    unit_vector,
    zero_vector,
)

RotorArrays = tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray]


@kernel
def fill_rigid_body(
    chain: ChainArrays,
    motion: FloatArray,
    of_base: bool,
    first_link: int,
    out: FloatArray,
    first: int,
    last: int,
) -> None:
    """Compute the columns of the ten parameters of every link from `first_link` (from 0) on.

    Args:
        chain: `Chain.arrays`.
        motion: Shape (3, samples, n). Joint positions, velocities, accelerations.
        of_base: True if the rows of `out` are the six components of the base wrench; False if they
            are the n joint torques.
        first_link: The first link that has columns.
        out: Shape (samples, 6 or n, 10 (n - first_link)). Every element is written, including
            zeros; the columns must be neighbours in memory. Order of the columns of a link: m, sx,
            sy, sz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz.
        first, last: The samples to fill.
    """
    rows, fixed_rotations, prismatic, gravity = chain
    joints, columns = motion.shape[2], out.shape[2]
    angular = np.empty((out.shape[1], 3, LANES))
    linear = np.empty((out.shape[1], 3, LANES))
    tile = np.zeros((out.shape[1], columns, LANES))
    for start in range(first, last, LANES):
        samples = eight_indices(start, last)
        w = dw = zero_vector()
        # Gravity has the same effect as an upward acceleration of the base.
        dv = (w[0] - gravity[0], w[1] - gravity[1], w[2] - gravity[2])
        active = _start_base_screws(of_base, angular, linear)
        for i in range(joints):
            q, qd = gather(motion[0], samples, i), gather(motion[1], samples, i)
            qdd = gather(motion[2], samples, i)
            rotation, offset = joint_frame(rows[i], fixed_rotations[i], prismatic[i], q)
            centripetal = cross(w, cross(w, offset))
            dv = turn(rotation, add(dv, add(cross(dw, offset), centripetal)))
            w, dw = angular_motion(rotation, w, dw, prismatic[i], qd, qdd)
            if prismatic[i]:
                dv = (dv[0] + 2.0 * w[1] * qd, dv[1] - 2.0 * w[0] * qd, dv[2] + qdd)
            for k in range(active):
                turning = load_vector(angular, k)
                sliding = add(load_vector(linear, k), cross(turning, offset))
                store_vector(turn(rotation, turning), angular, k)
                store_vector(turn(rotation, sliding), linear, k)
            if not of_base:
                _start_joint_screw(angular, linear, i, prismatic[i])
                active = i + 1
            if i >= first_link:
                _project(angular, linear, active, w, dw, dv, tile, 10 * (i - first_link))
        for k in range(out.shape[1]):
            for column in range(0, columns, LANES):
                place = min(column, columns - LANES)
                store_transposed(out, samples, k, place, tile)


@kernel
def fill_rotors(
    chain: ChainArrays,
    rotors: RotorArrays,
    motion: FloatArray,
    actuator: FloatArray,
    of_base: bool,
    out: FloatArray,
    first: int,
    last: int,
) -> None:
    """Compute the columns of the rotors' polar inertias (theory: section 3).

    Args:
        chain: `Chain.arrays`.
        rotors: `joint`, `link`, `axis` and `ratio` as in `Rotors`; then C^-T, shape (n, n), whose
            column j contains the joint torques that a unit torque of actuator j produces.
        motion, actuator: Shape (3, samples, n). Positions, velocities, accelerations of the joints
            and of the actuators.
        of_base: True if the rows of `out` are the six components of the base wrench; False if they
            are the n joint torques.
        out: Shape (samples, 6 or n, rotors). Every element is written, including zeros.
        first, last: The samples to fill.
    """
    rows, fixed_rotations, prismatic, _ = chain
    rotor_joint, rotor_link, rotor_axis, rotor_ratio, own_torque = rotors
    joints = motion.shape[2]
    angular = np.empty((out.shape[1], 3, LANES))
    linear = np.empty((out.shape[1], 3, LANES))
    for start in range(first, last, LANES):
        samples = eight_indices(start, last)
        w = dw = zero_vector()
        active = _start_base_screws(of_base, angular, linear)
        for link in range(joints + 1):
            if link > 0:
                i = link - 1
                q, qd = gather(motion[0], samples, i), gather(motion[1], samples, i)
                qdd = gather(motion[2], samples, i)
                rotation, _ = joint_frame(rows[i], fixed_rotations[i], prismatic[i], q)
                w, dw = angular_motion(rotation, w, dw, prismatic[i], qd, qdd)
                for k in range(active):
                    store_vector(turn(rotation, load_vector(angular, k)), angular, k)
                if not of_base:
                    _start_joint_screw(angular, linear, i, prismatic[i])
                    active = link
            for r in range(len(rotor_link)):
                if rotor_link[r] != link:
                    continue
                j = rotor_joint[r]
                axis = (rotor_axis[r, 0], rotor_axis[r, 1], rotor_axis[r, 2])
                spin = rotor_ratio[r] * gather(actuator[1], samples, j)
                spin_up = rotor_ratio[r] * gather(actuator[2], samples, j)
                load = add(scale(spin_up, axis), scale(spin, cross(w, axis)))
                own = rotor_ratio[r] * (spin_up + dot(axis, dw))
                for k in range(out.shape[1]):
                    row = 0.0 * own
                    if k < active:
                        row = dot(load_vector(angular, k), load)
                    if not of_base:
                        row = row + own_torque[k, j] * own
                    scatter(row, out[:, k], samples, r)


@kernel
def _start_base_screws(of_base: bool, angular: FloatArray, linear: FloatArray) -> int:
    """Set the six screws of the base, forces first, if `of_base`; return the number of screws."""
    if not of_base:
        return 0
    for k in range(3):
        store_vector(zero_vector(), angular, k)
        store_vector(unit_vector(k), linear, k)
        store_vector(unit_vector(k), angular, 3 + k)
        store_vector(zero_vector(), linear, 3 + k)
    return 6


@kernel
def _start_joint_screw(angular: FloatArray, linear: FloatArray, k: int, prismatic: bool) -> None:
    """Set the screw of joint k in its link's frame: a unit motion about, or along, the z axis."""
    store_vector(unit_vector(3 if prismatic else 2), angular, k)
    store_vector(unit_vector(2 if prismatic else 3), linear, k)


@kernel
def _project(
    angular: FloatArray,
    linear: FloatArray,
    active: int,
    w: Vector,
    dw: Vector,
    dv: Vector,
    tile: FloatArray,
    first: int,
) -> None:
    """Compute a link's ten columns: the virtual power of its unit loads for each active screw.

    The link's inertial force is m dv + dw x s + w x (w x s), its moment s x dv + I dw + w x (I w).
    The forces for unit sx, sy, sz (the columns of [dw] + [w][w]) and the moments for unit elements
    of I do not depend on the screw, so they are computed once.
    """
    xx, yy, zz = w[0] * w[0], w[1] * w[1], w[2] * w[2]
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    of_sx = (-(yy + zz), xy + dw[2], xz - dw[1])
    of_sy = (xy - dw[2], -(xx + zz), yz + dw[0])
    of_sz = (xz + dw[1], yz - dw[0], -(xx + yy))
    of_ixx = (dw[0], xz, -xy)
    of_ixy = (dw[1] - xz, dw[0] + yz, xx - yy)
    of_ixz = (dw[2] + xy, zz - xx, dw[0] - yz)
    of_iyy = (-yz, dw[1], xy)
    of_iyz = (yy - zz, dw[2] - xy, dw[1] + xz)
    of_izz = (yz, -xz, dw[2])
    for k in range(active):
        turning, sliding = load_vector(angular, k), load_vector(linear, k)
        moment = cross(dv, turning)
        store(dot(sliding, dv), tile, k, first)
        store(dot(sliding, of_sx) + moment[0], tile, k, first + 1)
        store(dot(sliding, of_sy) + moment[1], tile, k, first + 2)
        store(dot(sliding, of_sz) + moment[2], tile, k, first + 3)
        store(dot(turning, of_ixx), tile, k, first + 4)
        store(dot(turning, of_ixy), tile, k, first + 5)
        store(dot(turning, of_ixz), tile, k, first + 6)
        store(dot(turning, of_iyy), tile, k, first + 7)
        store(dot(turning, of_iyz), tile, k, first + 8)
        store(dot(turning, of_izz), tile, k, first + 9)
