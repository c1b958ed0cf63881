"""`RobotModel`: a robot's inverse dynamics, linear in all but a few nonlinear parameters."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling
from dynamics.geometry.kinematics import Chain
from dynamics.model.transmission import Transmission
from dynamics.terms.armature import Armature
from dynamics.terms.conditions import Conditions
from dynamics.terms.friction import Friction
from dynamics.terms.motion import TermMotion
from dynamics.terms.payload import Payload
from dynamics.terms.rigid_body import RigidBodies
from dynamics.terms.rotors import Rotors
from dynamics.terms.spring import Spring
from dynamics.terms.term import NonlinearTerm, Term
from dynamics.terms.term_parameter import NonlinearParameter

BLOCK_SAMPLES: Final = 512


@dataclass(frozen=True, eq=False)
class RobotModel:
    """Inverse dynamics tau = Phi(q, v, a) theta of one robot.

    Phi also depends on the motion's `Conditions`, and on the nonlinear parameters, which the terms
    and the transmission contain.

    Attributes:
        joint_names: Names of the joints from base to flange; all arrays have this order.
        chain: The geometry.
        terms: Terms of the model. `RigidBodies` is the first, so that the first 10 n parameters
            always belong to the links.
        transmission: Losses of the gears.
        coupling: Matrix C in q = C alpha (5.18), if an actuator moves several joints; else None.
        speed_limits: The joints' speed limits [rad/s or m/s]; empty if unknown.
    """

    joint_names: tuple[str, ...]
    chain: Chain
    terms: tuple[Term, ...]
    transmission: Transmission = field(default_factory=Transmission)
    coupling: WristCoupling | None = None
    speed_limits: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if len(self.joint_names) != self.chain.n:
            words = f"{len(self.joint_names)} joint names for a chain of {self.chain.n} joints"
            raise EstimationError(words, code="RID-API-ARGUMENT")
        names = self.parameter_names
        if len(set(names)) < len(names):
            doubled = sorted({name for name in names if names.count(name) > 1})
            words = f"two terms of the model have the same parameter {', '.join(doubled)}"
            raise EstimationError(words, code="RID-API-ARGUMENT")

    @classmethod
    def from_description(
        cls,
        robot: RobotDescription,
        *,
        rotors: bool = True,
        friction: bool = True,
        spring: bool = True,
        payload: bool = False,
        sign_smoothing_rad_s: float = 0.0,
    ) -> RobotModel:
        """Return the model of a robot description, without the terms that are switched off.

        `rotors` switches rotors and armatures; `friction` also switches the gears' load-dependent
        friction; `payload` adds an unknown body on the last link.

        Raises:
            ConfigError: The description's spring is invalid.
            EstimationError: `sign_smoothing_rad_s` is negative.
        """
        chain = Chain.from_description(robot)
        terms: list[Term] = [RigidBodies(chain)]
        if rotors and any(joint.rotor is not None for joint in robot.joints):
            terms.append(Rotors.from_description(robot))
        if rotors and any(joint.armature for joint in robot.joints):
            terms.append(Armature.from_description(robot))
        if friction and any(joint.friction for joint in robot.joints):
            terms.append(
                Friction.from_description(robot, sign_smoothing_rad_s=sign_smoothing_rad_s)
            )
        if spring and robot.spring is not None:
            terms.append(Spring.from_description(robot))
        if payload:
            terms.append(Payload(chain))
        return cls(
            robot.joint_names,
            chain,
            tuple(terms),
            Transmission.from_description(robot, friction=friction),
            WristCoupling.of_robot(robot),
            tuple(joint.limits.velocity for joint in robot.joints),
        )

    @cached_property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the standard parameters, term by term."""
        return tuple(name for term in self.terms for name in term.parameter_names)

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Units of the standard parameters, in the order of `parameter_names`."""
        return tuple(unit for term in self.terms for unit in term.parameter_units)

    @cached_property
    def parameter_groups(self) -> dict[str, slice]:
        """Columns of each term, by the term's name, such as `rigid_body`."""
        ends = np.cumsum([len(term.parameter_names) for term in self.terms]).tolist()
        return {
            term.name: slice(start, end)
            for term, start, end in zip(self.terms, [0, *ends[:-1]], ends, strict=True)
        }

    @cached_property
    def _nonlinear(self) -> tuple[NonlinearParameter, ...]:
        terms = (term.nonlinear for term in self.terms if isinstance(term, NonlinearTerm))
        return (*(p for own in terms for p in own), *self.transmission.nonlinear)

    @cached_property
    def nonlinear_names(self) -> tuple[str, ...]:
        """Names of the nonlinear parameters, such as Stribeck velocities and gear losses."""
        return tuple(parameter.name for parameter in self._nonlinear)

    @property
    def nonlinear_units(self) -> tuple[str, ...]:
        """Units of the nonlinear parameters, in the order of `nonlinear_names`."""
        return tuple(parameter.unit for parameter in self._nonlinear)

    @property
    def nonlinear_values(self) -> FloatArray:
        """Values of the nonlinear parameters, in the order of `nonlinear_names`."""
        return np.array([parameter.value for parameter in self._nonlinear])

    @property
    def nonlinear_bounds(self) -> FloatArray:
        """Lowest and highest allowed values of the nonlinear parameters, one row each."""
        return np.array([(p.low, p.high) for p in self._nonlinear]).reshape(-1, 2)

    @property
    def nonlinear_at_bound(self) -> tuple[str, ...]:
        """Names of the nonlinear parameters whose values are at a limit of their allowed range."""
        return tuple(p.name for p in self._nonlinear if not p.low < p.value < p.high)

    def with_nonlinear(self, values: npt.ArrayLike) -> RobotModel:
        """Return a copy of the model with other values of the nonlinear parameters.

        Raises:
            EstimationError: The number of values differs from that of `nonlinear_names`.
        """
        rest = np.asarray(values, dtype=np.float64)
        if rest.shape != (len(self._nonlinear),):
            raise EstimationError(
                f"the model has {len(self._nonlinear)} nonlinear parameters"
                f" ({', '.join(self.nonlinear_names) or 'none'}), got an array of shape"
                f" {rest.shape}",
                code="RID-API-ARGUMENT",
            )
        terms: list[Term] = []
        for term in self.terms:
            if isinstance(term, NonlinearTerm):
                count = len(term.nonlinear)
                terms.append(term.with_nonlinear(rest[:count]))
                rest = rest[count:]
            else:
                terms.append(term)
        return replace(
            self, terms=tuple(terms), transmission=self.transmission.with_nonlinear(rest)
        )

    def motion(
        self,
        q: npt.ArrayLike,
        v: npt.ArrayLike,
        a: npt.ArrayLike,
        conditions: Conditions | None = None,
    ) -> TermMotion:
        """Return a motion of this robot for its terms; see `TermMotion.of`."""
        return TermMotion.of(q, v, a, self.chain.n, self.coupling, conditions)

    def actuator_speed(self, v: FloatArray) -> FloatArray:
        """Convert joint velocities (samples, n) to actuator velocities, link side (5.18)."""
        return v if self.coupling is None else self.coupling.to_motors(v)


def regressor(
    model: RobotModel,
    q: npt.ArrayLike,
    v: npt.ArrayLike,
    a: npt.ArrayLike,
    conditions: Conditions | None = None,
) -> FloatArray:
    """Return the regressor Phi: tau = Phi theta are the actuators' torques at the link side.

    Args:
        model: The robot.
        q, v, a: Shape (samples, n). Joint positions, velocities, accelerations [rad or m, per s,
            per s^2].
        conditions: Temperature, load, payload and presliding hysteresis, if the model depends on
            them.

    Returns:
        Shape (samples, n, parameters). Torque [N m] or force [N] per unit of each of
        `model.parameter_names`. Without coupling, an actuator's torque is that of its joint.

    Raises:
        EstimationError: q, v and a do not all have the shape (samples, n), or a condition is
            missing.
    """
    motion = model.motion(q, v, a, conditions)
    out = np.empty((*motion.joint.shape[1:], len(model.parameter_names)))
    _fill(model, motion, out)
    return out


def regressor_blocks(
    model: RobotModel,
    q: npt.ArrayLike,
    v: npt.ArrayLike,
    a: npt.ArrayLike,
    conditions: Conditions | None = None,
    *,
    block: int = BLOCK_SAMPLES,
) -> Iterator[tuple[slice, FloatArray]]:
    """Yield the regressor in blocks of samples, so that only one block is in memory.

    Args:
        model, q, v, a, conditions: As for `regressor`.
        block: Samples per block; blocks of the default size fit into the cache of a processor core.

    Yields:
        `samples`. Range of the samples in the block. `phi`, shape (samples, n, parameters).
        Regressor of these samples. The next block overwrites this array.

    Raises:
        EstimationError: As for `regressor`.
    """
    motion = model.motion(q, v, a, conditions)
    _, samples, n = motion.joint.shape
    buffer = np.empty((min(block, samples), n, len(model.parameter_names)))
    for start in range(0, samples, block):
        piece = slice(start, min(start + block, samples))
        phi = buffer[: piece.stop - start]
        _fill(model, motion.part(piece), phi)
        yield piece, phi


def _fill(model: RobotModel, motion: TermMotion, out: FloatArray) -> None:
    factors = model.transmission.factors(motion)
    for term, columns in zip(model.terms, model.parameter_groups.values(), strict=True):
        own = out[:, :, columns]
        if not isinstance(term, RigidBodies):  # `RigidBodies` writes all elements
            own[...] = 0.0
        term.fill_torque(motion, own)
        if factors is not None and term.through_gears:
            own *= factors[:, :, np.newaxis]


def base_wrench_regressor(
    model: RobotModel,
    q: npt.ArrayLike,
    v: npt.ArrayLike,
    a: npt.ArrayLike,
    conditions: Conditions | None = None,
) -> FloatArray:
    """Return the regressor Phi_e: w = Phi_e theta is the wrench of the base on the robot.

    At rest, the force is equal to the robot's weight and points up. A force plate under the base
    measures the opposite wrench. The regressor is one more step of the backward Newton-Euler
    recursion (theory: section 7).

    Args:
        model, q, v, a, conditions: As for `regressor`.

    Returns:
        Shape (samples, 6, parameters). Fx, Fy, Fz [N], then Mx, My, Mz [N m], about the origin and
        in the axes of the base frame, per unit parameter. The columns of friction and spring are
        zero, because these act between two links. Those of armatures are zero, because the motors'
        mounting is unknown. A rotor contributes only the moment with which it loads the link that
        carries it, not the torque on its own joint.

    Raises:
        EstimationError: q, v and a do not all have the shape (samples, n).
    """
    motion = model.motion(q, v, a, conditions)
    out = np.zeros((motion.joint.shape[1], 6, len(model.parameter_names)))
    for term, columns in zip(model.terms, model.parameter_groups.values(), strict=True):
        term.fill_base_wrench(motion, out[:, :, columns])
    return out


def torque(
    model: RobotModel,
    q: npt.ArrayLike,
    v: npt.ArrayLike,
    a: npt.ArrayLike,
    parameters: npt.ArrayLike,
    conditions: Conditions | None = None,
) -> FloatArray:
    """Return the actuators' torques at the link side, (samples, n) [N m or N].

    Args:
        model: The robot.
        q, v, a: Shape (samples, n). Joint positions, velocities, accelerations [rad or m, per s,
            per s^2].
        parameters: Shape (parameters,). Values of `model.parameter_names`, in their order and
            units.
        conditions: Temperature, payload and presliding hysteresis; `load_nm` is computed here.

    Raises:
        EstimationError: A shape does not fit the model, or a condition is missing.
    """
    theta = checked_parameters(model, parameters)
    if model.transmission.losses:
        load = load_torque(model, q, v, a, theta, conditions)
        conditions = replace(conditions or Conditions(), load_nm=load)
    tau = np.empty(np.shape(q))
    for samples, phi in regressor_blocks(model, q, v, a, conditions):
        tau[samples] = (phi.reshape(-1, len(theta)) @ theta).reshape(phi.shape[:2])
    return tau


def load_torque(
    model: RobotModel,
    q: npt.ArrayLike,
    v: npt.ArrayLike,
    a: npt.ArrayLike,
    parameters: npt.ArrayLike,
    conditions: Conditions | None = None,
) -> FloatArray:
    """Return the torque that each gear would transmit without losses, (samples, n) [N m or N].

    It is the torque of links, payload and spring, in actuator coordinates, and is passed on as
    `Conditions.load_nm`.

    Raises:
        EstimationError: A shape does not fit the model.
    """
    theta = checked_parameters(model, parameters)
    motion = model.motion(q, v, a, conditions)
    load = np.zeros(motion.joint.shape[1:])
    for term, columns in zip(model.terms, model.parameter_groups.values(), strict=True):
        if term.through_gears:
            out = np.zeros((*load.shape, len(term.parameter_names)))
            term.fill_torque(motion, out)
            load += out @ theta[columns]
    return load


def checked_parameters(model: RobotModel, parameters: npt.ArrayLike) -> FloatArray:
    """Return the parameters as an array of the model's number of parameters.

    Raises:
        EstimationError: The number of values differs from the number of the model's parameters.
    """
    theta, expected = np.asarray(parameters, dtype=np.float64), len(model.parameter_names)
    if theta.shape != (expected,):
        words = f"the model has {expected} parameters, got an array of shape {theta.shape}"
        raise EstimationError(words, code="RID-API-ARGUMENT")
    return theta
