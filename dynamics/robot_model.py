"""`RobotModel`: the sum of the terms, linear in the parameters."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from config.errors import EstimationError
from config.robot import RobotDescription
from dynamics.friction import Friction
from dynamics.kinematics import Chain, FloatArray
from dynamics.rigid_body import RigidBodies
from dynamics.rotors import Rotors
from dynamics.spring import Spring


class Term(Protocol):
    """A part of the model: names, units, and the columns that belong to them.

    To give robots a new effect, write a class like this and add it to `RobotModel.terms`.
    `motion` is (3, samples, n): q, v, a; `out` is zero on entry and has a column a parameter.
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """What the group of parameters is called."""

    @property
    @abstractmethod
    def parameter_names(self) -> tuple[str, ...]:
        """One name a column, unlike every other term's."""

    @property
    @abstractmethod
    def parameter_units(self) -> tuple[str, ...]:
        """The units, in the order of the names."""

    @abstractmethod
    def fill_torque(self, motion: FloatArray, out: FloatArray) -> None:
        """Fill `out`, (samples, n, parameters): actuator torque, link side, per unit parameter."""

    @abstractmethod
    def fill_base_wrench(self, motion: FloatArray, out: FloatArray) -> None:
        """Fill `out`, (samples, 6, parameters): base wrench per unit parameter."""


@dataclass(frozen=True, eq=False)
class RobotModel:
    """Inverse dynamics tau = Phi(q, v, a) theta of one robot.

    Attributes
    ----------
    joint_names : tuple of str
        Base to flange; the joints of every array's last or second axis.
    chain : Chain
        The geometry.
    terms : tuple of Term
        The rigid bodies first, so that the first 10 n parameters are always the links'.
    """

    joint_names: tuple[str, ...]
    chain: Chain
    terms: tuple[Term, ...]

    def __post_init__(self) -> None:
        if len(self.joint_names) != self.chain.n:
            raise EstimationError(
                f"{len(self.joint_names)} joint names for a chain of {self.chain.n} joints"
            )
        names = self.parameter_names
        doubled = sorted({name for name in names if names.count(name) > 1})
        if doubled:
            raise EstimationError(f"two terms of the model name a parameter {', '.join(doubled)}")

    @classmethod
    def from_description(
        cls,
        robot: RobotDescription,
        *,
        rotors: bool = True,
        friction: bool = True,
        spring: bool = True,
        sign_smoothing_rad_s: float = 0.0,
    ) -> RobotModel:
        """Build the model of what the description has, less the terms that are switched off.

        Raises
        ------
        ConfigError
            Where the description's spring cannot be meant.
        EstimationError
            Where `sign_smoothing_rad_s` is negative.
        """
        chain = Chain.from_description(robot)
        terms: list[Term] = [RigidBodies(chain)]
        if rotors and any(joint.rotor is not None for joint in robot.joints):
            terms.append(Rotors.from_description(robot))
        if friction and any(joint.friction for joint in robot.joints):
            terms.append(
                Friction.from_description(robot, sign_smoothing_rad_s=sign_smoothing_rad_s)
            )
        if spring and robot.spring is not None:
            terms.append(Spring.from_description(robot))
        return cls(robot.joint_names, chain, tuple(terms))

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """The standard parameters, term by term."""
        return tuple(name for term in self.terms for name in term.parameter_names)

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Their units, in the order of the names."""
        return tuple(unit for term in self.terms for unit in term.parameter_units)

    @property
    def parameter_groups(self) -> dict[str, slice]:
        """Which columns belong to which term: `rigid_body`, `rotors`, `friction`, `spring`."""
        ends = np.cumsum([len(term.parameter_names) for term in self.terms]).tolist()
        return {
            term.name: slice(start, end)
            for term, start, end in zip(self.terms, [0, *ends[:-1]], ends, strict=True)
        }


def regressor(
    model: RobotModel, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike
) -> FloatArray:
    """Return Phi with tau = Phi theta, the actuators' torques at the link side.

    Parameters
    ----------
    model : RobotModel
        The robot.
    q, v, a : (samples, n) arrays
        Joint positions, velocities, accelerations [rad or m, per s, per s^2].

    Returns
    -------
    (samples, n, parameters) array
        N m (N for a prismatic joint) per unit of each of `model.parameter_names`.

    Raises
    ------
    EstimationError
        Where q, v and a do not all have the shape (samples, n).
    """
    motion = _motion(model, q, v, a)
    out = np.zeros((*motion.shape[1:], len(model.parameter_names)))
    for term, columns in zip(model.terms, model.parameter_groups.values(), strict=True):
        term.fill_torque(motion, out[:, :, columns])
    return out


def base_wrench_regressor(
    model: RobotModel, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike
) -> FloatArray:
    """Return Phi_e with w = Phi_e theta, the wrench that the base exerts on the robot.

    At rest its force is the weight, pointing up; a force plate under the base feels the opposite
    (physics: section 7, one more backward Newton-Euler step).

    Parameters
    ----------
    model : RobotModel
        The robot.
    q, v, a : (samples, n) arrays
        Joint positions, velocities, accelerations [rad or m, per s, per s^2].

    Returns
    -------
    (samples, 6, parameters) array
        Fx, Fy, Fz [N], then Mx, My, Mz [N m] about the base frame's origin, in its axes. The base
        feels neither friction nor spring (their columns are zero) nor the rotors' motor side.

    Raises
    ------
    EstimationError
        Where q, v and a do not all have the shape (samples, n).
    """
    motion = _motion(model, q, v, a)
    out = np.zeros((motion.shape[1], 6, len(model.parameter_names)))
    for term, columns in zip(model.terms, model.parameter_groups.values(), strict=True):
        term.fill_base_wrench(motion, out[:, :, columns])
    return out


def torque(
    model: RobotModel,
    q: npt.ArrayLike,
    v: npt.ArrayLike,
    a: npt.ArrayLike,
    parameters: npt.ArrayLike,
) -> FloatArray:
    """Return the actuators' torques at the link side, (samples, n) [N m or N].

    Parameters
    ----------
    model : RobotModel
        The robot.
    q, v, a : (samples, n) arrays
        Joint positions, velocities, accelerations [rad or m, per s, per s^2].
    parameters : (parameters,) array
        Values of `model.parameter_names`, in their order and units.

    Raises
    ------
    EstimationError
        Where a shape does not fit the model.
    """
    theta = np.asarray(parameters, dtype=np.float64)
    if theta.shape != (len(model.parameter_names),):
        raise EstimationError(
            f"the model has {len(model.parameter_names)} parameters, got an array of shape"
            f" {theta.shape}"
        )
    tau: FloatArray = regressor(model, q, v, a) @ theta
    return tau


def _motion(model: RobotModel, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike) -> FloatArray:
    """Stack q, v, a into one fresh array, so that kernels are compiled for one type only."""
    shapes = [np.shape(x) for x in (q, v, a)]
    expected = (*shapes[0][:1], model.chain.n)
    if shapes != [expected] * 3:
        raise EstimationError(
            f"q, v and a must all have the shape (samples, {model.chain.n}), got"
            f" {', '.join(map(str, shapes))}"
        )
    return np.array((q, v, a), dtype=np.float64)
