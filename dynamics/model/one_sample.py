"""`SampleTorque`: the model's torque for one sample at a time, for use in a controller.

The regressor's kernels (`dynamics.kernels.rigid_body`) compute eight samples at once. A controller
needs only the torque of one sample, without the regressor. This module therefore uses the
Newton-Euler recursion of the thesis's appendix B for a single sample, in preallocated memory. It
contains all terms of the model except the payload.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from config.arrays import BoolArray, FloatArray
from config.errors import EstimationError
from config.robot.wrist_coupling import WristCoupling
from dynamics.kernels.friction import BY_SPEED, friction_function
from dynamics.kernels.simd import kernel
from dynamics.model.memory import presliding_of_model
from dynamics.model.robot_model import RobotModel, checked_parameters
from dynamics.terms.armature import Armature
from dynamics.terms.friction import Friction
from dynamics.terms.friction_functions import traits
from dynamics.terms.payload import Payload
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK, RigidBodies
from dynamics.terms.rotors import Rotors
from dynamics.terms.spring import Spring

Vector: TypeAlias = tuple[float, float, float]
ModelArrays: TypeAlias = tuple[
    FloatArray,  # (n, 5) the chain's rows
    FloatArray,  # (n, 3, 3) the chain's fixed rotations
    BoolArray,  # (n,) True for prismatic joints
    FloatArray,  # (n + 2, 10) links' parameters; gravity and smoothing of sign(v); spring
    FloatArray,  # (terms, 8) rotors, armatures, friction, losses
    FloatArray,  # (2, n, n) C and C^-1
    FloatArray,  # (n + 6, 21 or more) working memory
]

# Kinds of terms, and the columns of the table of terms.
_ROTOR, _ARMATURE, FRICTION, EFFICIENCY, _LOAD = 0.0, 1.0, 2.0, 3.0, 4.0
KIND, JOINT, VALUE, FUNCTION, SPEED = 0, 1, 2, 3, 4
_LINK, _AXIS, _RATIO = 3, 4, 7
_NO_SPRING, _STRAIGHT, _FOURIER = 0.0, 1.0, 2.0
# Rows of the working memory after the n rows of the links: actuator speeds; load torques (through
# the gears, before losses) and free torques (not through the gears) of the last sample; motions of
# the links; base wrench, as in `base_wrench_regressor`. The last row is an input: the direction of
# each actuator's presliding hysteresis, or `BY_SPEED`.
_ACTUATOR, LOAD_TORQUE, FREE_TORQUE, _LINK_MOTION, BASE_WRENCH, DIRECTION = 0, 1, 2, 3, 4, 5


@dataclass(frozen=True, eq=False)
class SampleTorque:
    """A robot's model with parameter values, which can be evaluated sample by sample.

    Attributes:
        joints: Number of joints.
        arrays: The argument `model` of `sample_torque`.
        presliding: Shape (2, n). First row: presliding distance of each actuator [rad or m], 0
            without presliding. Second row: fraction of its friction with hysteresis. This class
            ignores both: a single sample does not contain the joint's history, so friction follows
            sign(v). `dynamics.model.hysteretic_sample` computes the torque with hysteresis.
    """

    joints: int
    arrays: ModelArrays
    presliding: FloatArray

    @classmethod
    def of(
        cls, model: RobotModel, parameters: npt.ArrayLike, *, least_smoothing_rad_s: float = 0.0
    ) -> SampleTorque:
        """Return the torque function of a model with parameter values, without payload.

        Args:
            model: The robot.
            parameters: Shape (parameters,). Values of `model.parameter_names`, in their order and
                units.
            least_smoothing_rad_s: Lower bound of the model's `sign_smoothing_rad_s`, so that
                rounding errors of v at rest cause no friction torque.

        Raises:
            EstimationError: The number of parameters is wrong, friction depends on the drives'
                temperature, or the model has a term that is not supported here.
        """
        theta = checked_parameters(model, parameters)
        n = model.chain.n
        bodies = np.zeros((n + 2, PARAMETERS_PER_LINK))
        bodies[n, :3] = model.chain.gravity_m_s2
        terms: list[list[float]] = []
        for term, columns in zip(model.terms, model.parameter_groups.values(), strict=True):
            values = theta[columns].tolist()
            match term:
                case RigidBodies():
                    bodies[:n] = theta[columns].reshape(n, PARAMETERS_PER_LINK)
                case Payload():
                    pass  # the payload is not attached
                case Rotors():
                    terms += _rotors(term, values)
                case Armature():
                    terms += [
                        [_ARMATURE, joint, value]
                        for joint, value in zip(term.joints, values, strict=True)
                    ]
                case Friction():
                    bodies[n, 3] = max(term.sign_smoothing_rad_s, least_smoothing_rad_s)
                    terms += _friction(term, values)
                case Spring():
                    form = _FOURIER if term.distances_m is None else _STRAIGHT
                    numbers = values if term.distances_m is None else [*values, *term.distances_m]
                    bodies[n + 1, : 2 + len(numbers)] = [form, term.joint, *numbers]
                case _:
                    raise EstimationError(
                        f"the torque of one sample does not support the term {term.name!r}: leave"
                        " it out of the model, or add it to `dynamics/model/one_sample.py`",
                        code="RID-MODEL-TERM",
                    )
        for loss in model.transmission.losses:
            kind = EFFICIENCY if loss.kind == "efficiency" else _LOAD
            terms.append([kind, loss.joint, loss.parameter.value])
        table = np.zeros((len(terms), 8))
        for row, numbers in zip(table, terms, strict=True):
            row[: len(numbers)] = numbers
        coupling = model.coupling or WristCoupling.of_matrix(np.eye(n))
        presliding_parameters = np.zeros((2, n))
        for own in presliding_of_model(model):
            presliding_parameters[:, own.joint] = own.distance.value, own.fraction_value
        memory = np.zeros((n + 6, max(21, n, 6 * (n + 1))))
        memory[n + DIRECTION] = BY_SPEED
        return cls(
            joints=n,
            presliding=presliding_parameters,
            arrays=(
                np.ascontiguousarray(model.chain.rows),
                np.ascontiguousarray(model.chain.fixed_rotations),
                np.ascontiguousarray(model.chain.prismatic),
                bodies,
                table,
                np.array([coupling.joints_by_motors, coupling.motors_by_joints]),
                memory,
            ),
        )

    def __call__(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return the actuators' torques, link side, shape (n,) [N m or N].

        Args:
            q, v, a: Shape (n,). Joint positions, velocities, accelerations [rad or m, per s, per
                s^2].
        """
        torque = np.empty(self.joints)
        sample_torque(self.arrays, q, v, a, torque)
        return torque


def _rotors(term: Rotors, values: list[float]) -> list[list[float]]:
    return [
        [_ROTOR, int(term.joint[k]), value, int(term.link[k]), *term.axis[k], float(term.ratio[k])]
        for k, value in enumerate(values)
    ]


def _friction(term: Friction, values: list[float]) -> list[list[float]]:
    speeds = {speed.joint: speed.parameter.value for speed in term.stribeck}
    rows = []
    for column, value in zip(term.columns, values, strict=True):
        kernel_number = traits(column.function).kernel
        if kernel_number is None:
            raise EstimationError(
                f"{column.parameter_name} depends on the drive's temperature, which is not known"
                " before the motion: state a temperature, or identify a model without the"
                " friction term `temperature`",
                code="RID-MODEL-TEMPERATURE",
            )
        match column.function:
            case "stribeck":
                scale = speeds[column.joint]
            case "shear_thinning":
                scale = column.shear_thinning_speed
            case _:
                scale = 1.0
        rows.append([FRICTION, column.joint, value, kernel_number, scale])
    return rows


@kernel
def sample_torque(
    model: ModelArrays, q: FloatArray, v: FloatArray, a: FloatArray, torque: FloatArray
) -> None:
    """Compute the actuators' torques of one sample, link side.

    Args:
        model: `SampleTorque.arrays`; the last array is overwritten.
        q, v, a: Shape (n,). Joint positions, velocities, accelerations.
        torque: Shape (n,). Output: the torques [N m or N].
    """
    rows, fixed, prismatic, bodies, terms, coupling, memory = model
    n = len(q)
    speed, carried = memory[n + _ACTUATOR], memory[n + LOAD_TORQUE]
    free, links = memory[n + FREE_TORQUE], memory[n + _LINK_MOTION]
    base = memory[n + BASE_WRENCH]
    w = (0.0, 0.0, 0.0)
    dw = (0.0, 0.0, 0.0)
    dv = (-bodies[n, 0], -bodies[n, 1], -bodies[n, 2])
    _store_motion(w, dw, links, 0)
    for i in range(n):
        slide = q[i] if prismatic[i] else 0.0
        angle = rows[i, 2] + (q[i] - slide)
        c, s = math.cos(angle), math.sin(angle)
        f = fixed[i]
        x = (c * f[0, 0] + s * f[0, 1], c * f[1, 0] + s * f[1, 1], c * f[2, 0] + s * f[2, 1])
        y = (c * f[0, 1] - s * f[0, 0], c * f[1, 1] - s * f[1, 0], c * f[2, 1] - s * f[2, 0])
        z = (f[0, 2], f[1, 2], f[2, 2])
        d = rows[i, 4] + slide
        offset = (rows[i, 3] + d * z[0], d * z[1], d * z[2])
        moved = _add(dv, _add(_cross(dw, offset), _cross(w, _cross(w, offset))))
        dv = (_dot(x, moved), _dot(y, moved), _dot(z, moved))
        w = (_dot(x, w), _dot(y, w), _dot(z, w))
        dw = (_dot(x, dw), _dot(y, dw), _dot(z, dw))
        if prismatic[i]:
            dv = (dv[0] + 2.0 * w[1] * v[i], dv[1] - 2.0 * w[0] * v[i], dv[2] + a[i])
        else:
            dw = (dw[0] + w[1] * v[i], dw[1] - w[0] * v[i], dw[2] + a[i])
            w = (w[0], w[1], w[2] + v[i])
        _store_motion(w, dw, links, i + 1)
        body = bodies[i]
        first = (body[1], body[2], body[3])
        load = _add(_cross(dw, first), _cross(w, _cross(w, first)))
        force = (body[0] * dv[0] + load[0], body[0] * dv[1] + load[1], body[0] * dv[2] + load[2])
        spin = _inertia(body, w)
        moment = _add(_cross(first, dv), _add(_inertia(body, dw), _cross(w, spin)))
        row = memory[i]
        row[0], row[1], row[2] = x
        row[3], row[4], row[5] = y
        row[6], row[7], row[8] = z
        row[9], row[10], row[11] = offset
        row[12], row[13], row[14] = force
        row[15], row[16], row[17] = moment
        row[18] = row[19] = row[20] = 0.0
    for i in range(n):
        free[i] = carried[i] = speed[i] = 0.0
        for j in range(n):
            speed[i] += coupling[1, i, j] * v[j]
    for c in range(6):
        base[c] = 0.0
    _add_actuator_torques(model, a, n)
    force = moment = turning = (0.0, 0.0, 0.0)  # sums over the links after link i + 1
    for i in range(n - 1, -1, -1):
        row = memory[i]
        force = _add(force, (row[12], row[13], row[14]))
        moment = _add(moment, (row[15], row[16], row[17]))
        turning = _add(turning, (row[18], row[19], row[20]))
        along = force[2] if prismatic[i] else moment[2]
        beside = 0.0 if prismatic[i] else turning[2]
        if bodies[n + 1, 0] != _NO_SPRING and int(bodies[n + 1, 1]) == i:
            along += _spring(bodies[n + 1], q[i])
        for j in range(n):
            carried[j] += coupling[0, i, j] * along
            free[j] += coupling[0, i, j] * beside
        force, moment, turning = (
            _to_previous_frame(row, force),
            _add(
                _to_previous_frame(row, moment),
                _cross((row[9], row[10], row[11]), _to_previous_frame(row, force)),
            ),
            _to_previous_frame(row, turning),
        )
    for c in range(3):
        base[c] = force[c]
        base[3 + c] += moment[c] + turning[c]
    for i in range(n):
        factor = 1.0
        direction = carried[i] * speed[i]
        way = 1.0 if direction > 0.0 else (-1.0 if direction < 0.0 else 0.0)
        remembered = memory[n + DIRECTION, i]
        if not math.isnan(remembered):
            way = remembered if carried[i] > 0.0 else (-remembered if carried[i] < 0.0 else 0.0)
        for k in range(len(terms)):
            if terms[k, KIND] >= EFFICIENCY and int(terms[k, JOINT]) == i:
                if terms[k, KIND] == EFFICIENCY:
                    factor *= terms[k, VALUE] ** -way
                else:
                    factor *= 1.0 + terms[k, VALUE] * way
        torque[i] = factor * carried[i] + free[i]


@kernel
def _add_actuator_torques(model: ModelArrays, a: FloatArray, n: int) -> None:
    """Add the torques that the gears do not transmit: rotors, armatures, friction."""
    bodies, terms, coupling, memory = model[3], model[4], model[5], model[6]
    speed, free, links = memory[n + _ACTUATOR], memory[n + FREE_TORQUE], memory[n + _LINK_MOTION]
    smoothing = bodies[n, 3]
    for k in range(len(terms)):
        term = terms[k]
        j = int(term[JOINT])
        if term[KIND] == FRICTION:
            shape = friction_function(
                int(term[FUNCTION]), speed[j], term[SPEED], smoothing, memory[n + DIRECTION, j]
            )
            free[j] += term[VALUE] * shape
        elif term[KIND] <= _ARMATURE:
            faster = 0.0
            for i in range(n):
                faster += coupling[1, j, i] * a[i]
            if term[KIND] == _ARMATURE:
                free[j] += term[VALUE] * faster
                continue
            link = int(term[_LINK])
            axis = (term[_AXIS], term[_AXIS + 1], term[_AXIS + 2])
            w = (links[6 * link], links[6 * link + 1], links[6 * link + 2])
            dw = (links[6 * link + 3], links[6 * link + 4], links[6 * link + 5])
            ratio = term[_RATIO]
            free[j] += term[VALUE] * ratio * (ratio * faster + _dot(axis, dw))
            across = _cross(w, axis)
            gyro = term[VALUE] * ratio
            place, first = (link - 1, 18) if link > 0 else (n + BASE_WRENCH, 3)
            for c in range(3):
                memory[place, first + c] += gyro * (faster * axis[c] + speed[j] * across[c])


@kernel
def _spring(spring: FloatArray, q: float) -> float:
    if spring[0] == _FOURIER:
        total = 0.0
        for k in range(3):
            angle = (k + 1) * q
            total += spring[2 + 2 * k] * math.cos(angle) + spring[3 + 2 * k] * math.sin(angle)
        return total
    far, near = spring[4], spring[5]
    length = math.sqrt(far * far + near * near - 2.0 * far * near * math.cos(q))
    return float(far * near * math.sin(q) * (spring[2] - spring[3] / length))


@kernel
def _store_motion(w: Vector, dw: Vector, links: FloatArray, link: int) -> None:
    for c in range(3):
        links[6 * link + c] = w[c]
        links[6 * link + 3 + c] = dw[c]


@kernel
def _inertia(body: FloatArray, u: Vector) -> Vector:
    return (
        body[4] * u[0] + body[5] * u[1] + body[6] * u[2],
        body[5] * u[0] + body[7] * u[1] + body[8] * u[2],
        body[6] * u[0] + body[8] * u[1] + body[9] * u[2],
    )


@kernel
def _to_previous_frame(row: FloatArray, u: Vector) -> Vector:
    """Transform a vector from a link's frame to the previous link's frame."""
    return (
        row[0] * u[0] + row[3] * u[1] + row[6] * u[2],
        row[1] * u[0] + row[4] * u[1] + row[7] * u[2],
        row[2] * u[0] + row[5] * u[1] + row[8] * u[2],
    )


@kernel
def _cross(a: Vector, b: Vector) -> Vector:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _add(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])
