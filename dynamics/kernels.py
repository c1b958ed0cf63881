"""The compiled sweeps along the chain; the only file of the package that imports numba.

Both kernels carry, from the base outwards, the motion of each link and the *screws* that are asked
about, all in the link's own frame. A screw is a unit motion: of a joint, which asks for the torque
of its actuator, or of the base, which asks for a component of the base wrench. A load on a link
then appears in a row with its virtual power on that row's screw. This is the modified recursive
Newton-Euler method (appendix B) with the backward recursion replaced by its transpose.

Motions may be complex: the derivatives are taken by the complex step (see `inverse_dynamics`).
Vectors are tuples, which the compiler keeps in registers. All kernels share one file because
numba's cache on disk notices a change in the kernel's own file only.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from dynamics.kinematics import BoolArray, FloatArray, IntArray

Vector = tuple[float, float, float]
Rotation = tuple[Vector, Vector, Vector]  # its columns


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def fill_rigid_body(
    rows: FloatArray,
    fixed_rotations: FloatArray,
    prismatic: BoolArray,
    gravity: FloatArray,
    motion: FloatArray,
    of_base: bool,
    out: FloatArray,
) -> None:
    """Fill the columns of the ten parameters of every link.

    Parameters
    ----------
    rows, fixed_rotations, prismatic, gravity
        As in `Chain`.
    motion : (3, samples, n) array
        Joint positions, velocities, accelerations.
    of_base : bool
        Whether the rows of `out` are the six components of the base wrench or the n joints.
    out : (samples, 6 or n, 10 n) array
        Zero on entry. Per link: m, sx, sy, sz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz.
    """
    _, samples, joints = motion.shape
    angular = np.zeros((out.shape[1], 3), motion.dtype)
    linear = np.zeros((out.shape[1], 3), motion.dtype)
    for sample in range(samples):
        zero = 0.0 * motion[0, sample, 0]
        w = dw = (zero, zero, zero)
        # Gravity is an acceleration of the base.
        dv = (zero - gravity[0], zero - gravity[1], zero - gravity[2])
        active = _start_screws(of_base, angular, linear)
        for i in range(joints):
            q, qd, qdd = motion[0, sample, i], motion[1, sample, i], motion[2, sample, i]
            rotation, offset = _joint(rows[i], fixed_rotations[i], prismatic[i], q)
            dv = _turn(rotation, _add(dv, _add(_cross(dw, offset), _centripetal(w, offset))))
            w, dw = _angular_motion(rotation, w, dw, prismatic[i], qd, qdd)
            if prismatic[i]:
                dv = (dv[0] + 2.0 * w[1] * qd, dv[1] - 2.0 * w[0] * qd, dv[2] + qdd)
            for k in range(active):
                turning = _load(angular, k)
                sliding = _add(_load(linear, k), _cross(turning, offset))
                _store(angular, k, _turn(rotation, turning))
                _store(linear, k, _turn(rotation, sliding))
            if not of_base:
                _start_screw(angular, linear, i, prismatic[i])
                active = i + 1
            for k in range(active):
                _project(_load(angular, k), _load(linear, k), w, dw, dv, out[sample, k], 10 * i)


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def fill_rotors(
    rows: FloatArray,
    fixed_rotations: FloatArray,
    prismatic: BoolArray,
    rotor_joint: IntArray,
    rotor_link: IntArray,
    rotor_axis: FloatArray,
    rotor_ratio: FloatArray,
    motion: FloatArray,
    actuator: FloatArray,
    own_torque: FloatArray,
    of_base: bool,
    out: FloatArray,
) -> None:
    """Fill the column of every rotor's polar inertia (physics: section 3).

    Parameters
    ----------
    rows, fixed_rotations, prismatic
        As in `Chain`.
    rotor_joint, rotor_link, rotor_axis, rotor_ratio
        As in `Rotors`.
    motion, actuator : (3, samples, n) arrays
        Positions, velocities, accelerations of the joints and of the actuators.
    own_torque : (n, n) array
        C^-T: the joint torques (columns) that are one unit of torque on one actuator.
    of_base : bool
        Whether the rows of `out` are the six components of the base wrench or the n joints.
    out : (samples, 6 or n, rotors) array
        Zero on entry.
    """
    _, samples, joints = motion.shape
    angular = np.zeros((out.shape[1], 3), motion.dtype)
    linear = np.zeros((out.shape[1], 3), motion.dtype)
    for sample in range(samples):
        zero = 0.0 * motion[0, sample, 0]
        w = dw = (zero, zero, zero)
        active = _start_screws(of_base, angular, linear)
        for link in range(joints + 1):
            if link > 0:
                i = link - 1
                q, qd, qdd = motion[0, sample, i], motion[1, sample, i], motion[2, sample, i]
                rotation, _ = _joint(rows[i], fixed_rotations[i], prismatic[i], q)
                w, dw = _angular_motion(rotation, w, dw, prismatic[i], qd, qdd)
                for k in range(active):
                    _store(angular, k, _turn(rotation, _load(angular, k)))
                if not of_base:
                    _start_screw(angular, linear, i, prismatic[i])
                    active = link
            for r in range(len(rotor_link)):
                if rotor_link[r] != link:
                    continue
                j = rotor_joint[r]
                axis = _load(rotor_axis, r)
                spin = rotor_ratio[r] * actuator[1, sample, j]
                spin_up = rotor_ratio[r] * actuator[2, sample, j]
                load = _add(_scale(spin_up, axis), _scale(spin, _cross(w, axis)))
                for k in range(active):
                    out[sample, k, r] = _dot(_load(angular, k), load)
                if not of_base:
                    own = rotor_ratio[r] * (spin_up + _dot(axis, dw))
                    for k in range(joints):
                        out[sample, k, r] += own_torque[k, j] * own


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def _joint(
    row: FloatArray, fixed: FloatArray, prismatic: bool, q: float
) -> tuple[Rotation, Vector]:
    """Return rotation and origin of the joint's frame in the frame before it."""
    zero = 0.0 * q
    theta, d = (zero + row[2], row[4] + q) if prismatic else (row[2] + q, zero + row[4])
    c, s = np.cos(theta), np.sin(theta)
    x = (fixed[0, 0], fixed[1, 0], fixed[2, 0])
    y = (fixed[0, 1], fixed[1, 1], fixed[2, 1])
    z = (fixed[0, 2], fixed[1, 2], fixed[2, 2])
    rotation = (_add(_scale(c, x), _scale(s, y)), _add(_scale(c, y), _scale(-s, x)), z)
    return rotation, (row[3] + d * z[0], d * z[1], d * z[2])


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def _angular_motion(
    rotation: Rotation, w: Vector, dw: Vector, prismatic: bool, qd: float, qdd: float
) -> tuple[Vector, Vector]:
    """Carry angular velocity and acceleration over a joint."""
    w, dw = _turn(rotation, w), _turn(rotation, dw)
    if prismatic:
        return w, dw
    return (w[0], w[1], w[2] + qd), (dw[0] + w[1] * qd, dw[1] - w[0] * qd, dw[2] + qdd)


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def _start_screws(of_base: bool, angular: FloatArray, linear: FloatArray) -> int:
    """Start the six screws of the base, forces first; return how many screws are active."""
    if not of_base:
        return 0
    angular[:] = 0.0
    linear[:] = 0.0
    for k in range(3):
        linear[k, k] = 1.0
        angular[3 + k, k] = 1.0
    return 6


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def _start_screw(angular: FloatArray, linear: FloatArray, k: int, prismatic: bool) -> None:
    """Start the screw of a joint in its own frame: along z."""
    _store(angular, k, (0.0, 0.0, 0.0 if prismatic else 1.0))
    _store(linear, k, (0.0, 0.0, 1.0 if prismatic else 0.0))


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def _project(
    turning: Vector,
    sliding: Vector,
    w: Vector,
    dw: Vector,
    dv: Vector,
    row: FloatArray,
    first: int,
) -> None:
    """Write the virtual power, on a screw, of a link's ten unit inertial loads.

    Force m dv + dw x s + w x (w x s), moment s x dv + I dw + w x (I w), with the triple products
    turned until the parameter stands alone.
    """
    row[first] = _dot(sliding, dv)
    moment = _add(_cross(sliding, dw), _add(_cross(_cross(sliding, w), w), _cross(dv, turning)))
    row[first + 1], row[first + 2], row[first + 3] = moment
    t = _cross(turning, w)
    row[first + 4] = turning[0] * dw[0] + t[0] * w[0]
    row[first + 5] = turning[0] * dw[1] + turning[1] * dw[0] + t[0] * w[1] + t[1] * w[0]
    row[first + 6] = turning[0] * dw[2] + turning[2] * dw[0] + t[0] * w[2] + t[2] * w[0]
    row[first + 7] = turning[1] * dw[1] + t[1] * w[1]
    row[first + 8] = turning[1] * dw[2] + turning[2] * dw[1] + t[1] * w[2] + t[2] * w[1]
    row[first + 9] = turning[2] * dw[2] + t[2] * w[2]


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def _centripetal(w: Vector, p: Vector) -> Vector:
    return _cross(w, _cross(w, p))


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def _turn(rotation: Rotation, v: Vector) -> Vector:
    """Express a vector of the frame before in the rotated frame."""
    return (_dot(rotation[0], v), _dot(rotation[1], v), _dot(rotation[2], v))


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def _cross(a: Vector, b: Vector) -> Vector:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def _add(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def _scale(factor: float, a: Vector) -> Vector:
    return (factor * a[0], factor * a[1], factor * a[2])


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def _load(array: FloatArray, k: int) -> Vector:
    return (array[k, 0], array[k, 1], array[k, 2])


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def _store(array: FloatArray, k: int, vector: Vector) -> None:
    array[k, 0], array[k, 1], array[k, 2] = vector
