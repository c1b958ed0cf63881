"""`ElasticArm`: an arm whose motors and links are joined by springs with dampers.

q are the positions of the links, theta those of the motors divided by the gear ratios. With the
torque tau_link that a gear transmits (Spong 1987, with the motors' inertial coupling to the links):

    links:   M(q) q'' + c(q, q') + g(q) + spring(q) + S theta'' = tau_link
    gears:   tau_link = k (theta - q) + d (theta' - q')
    motors:  I (mu^2 theta'' + mu e . w') + friction(theta') + tau_link = tau_motor

k and d are the stiffness and damping of the gears, and S is the inertial coupling of motors and
links. A rotor has the polar inertia I, the gear ratio mu and the axis e; w is the angular velocity
of the link that carries it. A motor of unknown mounting has the inertia J = mu^2 I only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, base_wrench_regressor, regressor
from dynamics.model.transmission import Transmission
from dynamics.terms.motion import TermMotion
from dynamics.terms.rotors import Rotors
from identification.model.base_parameters import BaseParameters, base_parameters


class ElasticMotion(NamedTuple):
    """Motion of links and motors; each array has the shape (samples, n).

    Attributes:
        q, v, a: Positions, velocities and accelerations of the links [rad or m, per s, per s^2].
        motor_v, motor_a: Velocities and accelerations of the motors over the gear ratios.
    """

    q: FloatArray
    v: FloatArray
    a: FloatArray
    motor_v: FloatArray
    motor_a: FloatArray


@dataclass(frozen=True, eq=False)
class ElasticArm:
    """Structure of an arm with elastic gears; its parameters are arguments of the methods.

    The parameters are `body`, the b base parameters of links and spring, and `rotor`, one inertia
    per joint: the rotor's polar inertia I if its mounting is known, otherwise J at the link side.

    Attributes:
        robot: The robot.
        links: Model of links and spring, without motors and friction.
        base: Base parameters of `links`.
    """

    robot: RobotDescription
    links: RobotModel
    base: BaseParameters

    @classmethod
    def of(cls, robot: RobotDescription, *, plate: bool = False) -> ElasticArm:
        """Return the structure of a robot.

        Args:
            plate: True if a force plate measures the base wrench, which shows further parameters.

        Raises:
            EstimationError: The robot has a coupled wrist.
        """
        if robot.coupling is not None:
            raise EstimationError(
                f"robot {robot.name!r} has a coupled wrist, in which a motor turns several joints:"
                " the stiffness of its gears cannot be identified. If it is known, write"
                " stiffness_nm_rad into the robot file",
                code="RID-STIFFNESS-COUPLED-WRIST",
            )
        model = RobotModel.from_description(robot, rotors=False, friction=False)
        links = replace(model, transmission=Transmission())
        return cls(robot, links, base_parameters(links, kind="combined" if plate else "internal"))

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.robot.joints)

    @cached_property
    def _rotors(self) -> Rotors | None:
        mounted = any(joint.rotor is not None for joint in self.robot.joints)
        return Rotors.from_description(self.robot) if mounted else None

    @cached_property
    def _carriers(self) -> tuple[int | None, ...]:
        """For each joint, the number of the link that carries its motor; None if unknown."""
        return tuple(j.rotor.link if j.rotor is not None else None for j in self.robot.joints)

    @cached_property
    def reflected(self) -> FloatArray:
        """Motor inertia at the link side per unit of `rotor`, shape (n,)."""
        return np.array(
            [1.0 if j.rotor is None else j.gear_ratio**2 for j in self.robot.joints], dtype=float
        )

    def link_torque(self, motion: ElasticMotion, body: FloatArray, rotor: FloatArray) -> FloatArray:
        """Return the torque that each gear transmits, shape (samples, n) [N m or N]."""
        phi = self.base.columns(regressor(self.links, motion.q, motion.v, motion.a))
        tau = np.asarray(phi @ body)
        for j, own in self._moving_rotors(motion):
            reaction = own.copy()
            reaction[:, j] = self._own_reaction(j) * motion.motor_a[:, j]
            tau += rotor[j] * reaction
        return tau

    def motor_torque(self, motion: ElasticMotion, rotor: FloatArray) -> FloatArray:
        """Return the torques that accelerate the motors, shape (samples, n) [N m or N]."""
        tau: FloatArray = self.reflected * rotor * motion.motor_a
        for j, own in self._moving_rotors(motion):
            tau[:, j] = rotor[j] * own[:, j]
            turning = motion.a[:, j] - 2.0 * motion.motor_a[:, j]
            tau[:, j] += rotor[j] * self._own_reaction(j) * turning
        return tau

    def base_wrench(self, motion: ElasticMotion, body: FloatArray, rotor: FloatArray) -> FloatArray:
        """Return the wrench of the base on the robot, shape (samples, 6) [N, N m]."""
        phi = self.base.columns(base_wrench_regressor(self.links, motion.q, motion.v, motion.a))
        wrench = np.asarray(phi @ body)
        rotors = self._rotors
        for column, j in enumerate(() if rotors is None else rotors.joint.tolist()):
            assert rotors is not None
            own = np.zeros((len(motion.q), 6, len(rotors.joint)))
            rotors.fill_base_wrench(self._with_motor_of(motion, j), own)
            wrench += rotor[j] * own[:, :, column]
        return wrench

    def _moving_rotors(self, motion: ElasticMotion) -> list[tuple[int, FloatArray]]:
        """Return the joints whose motors sit on moving links, with torque columns (samples, n)."""
        rotors, found = self._rotors, []
        for column, j in enumerate(() if rotors is None else rotors.joint.tolist()):
            assert rotors is not None
            if self._carriers[j] == 0:
                continue
            own = np.zeros((*motion.q.shape, len(rotors.joint)))
            rotors.fill_torque(self._with_motor_of(motion, j), own)
            found.append((j, own[:, :, column]))
        return found

    def _with_motor_of(self, motion: ElasticMotion, joint: int) -> TermMotion:
        """Return the motion of a rigid arm in which one joint moves as its motor does."""
        v, a = motion.v.copy(), motion.a.copy()
        v[:, joint], a[:, joint] = motion.motor_v[:, joint], motion.motor_a[:, joint]
        return self.links.motion(motion.q, v, a)

    def _own_reaction(self, joint: int) -> float:
        """Return mu (e . z) of a motor that is mounted on the link that it moves; otherwise 0.

        Such a motor accelerates with the link that it moves, in addition to its own rotation, and
        its reaction acts on this link.
        """
        description = self.robot.joints[joint]
        if description.rotor is None or self._carriers[joint] != joint + 1:
            return 0.0
        return description.gear_ratio * description.rotor.axis[2]


@dataclass(frozen=True, eq=False)
class SmallMotion:
    """The equations of an arm for small motions about some poses, linear in all parameters.

    They are averaged over the poses, which are those of the slow motion under a multisine.

    Attributes:
        mass: Shape (n, n, b). Link torque per link acceleration, per base parameter.
        slope: Shape (n, n, b). Link torque per link position.
        reaction: Shape (n, n, n). Link torque per motor acceleration, per `rotor`.
        carried: Shape (n, n, n). Motor torque per link acceleration, per `rotor`.
        own: Shape (n, n). Motor torque per own motor acceleration, per `rotor`.
    """

    mass: FloatArray
    slope: FloatArray
    reaction: FloatArray
    carried: FloatArray
    own: FloatArray

    @classmethod
    def of(cls, arm: ElasticArm, poses: FloatArray) -> SmallMotion:
        """Linearise an arm about poses of shape (poses, n)."""
        n, zero, step = arm.n, np.zeros_like(poses), 1e-4

        def columns(q: FloatArray, a: FloatArray) -> FloatArray:
            return arm.base.columns(regressor(arm.links, q, zero, a))

        at_rest = columns(poses, zero)
        mass, slope = (np.zeros((n, n, len(arm.base))) for _ in range(2))
        reaction, carried = np.zeros((n, n, n)), np.zeros((n, n, n))
        own = np.zeros((n, n))
        none = np.zeros(len(arm.base))
        for i in range(n):
            unit = zero.copy()
            unit[:, i] = 1.0
            mass[:, i] = (columns(poses, unit) - at_rest).mean(axis=0)
            shifted = columns(poses + step * unit, zero) - columns(poses - step * unit, zero)
            slope[:, i] = shifted.mean(axis=0) / (2.0 * step)
            by_link = ElasticMotion(poses, zero, unit, zero, zero)
            by_motor = ElasticMotion(poses, zero, zero, zero, unit)
            for j in range(n):
                one = np.eye(n)[j]
                reaction[:, i, j] = arm.link_torque(by_motor, none, one).mean(axis=0)
                carried[:, i, j] = arm.motor_torque(by_link, one).mean(axis=0)
                if i == j:
                    own[:, j] = arm.motor_torque(by_motor, one).mean(axis=0)
        return cls(mass, slope, reaction, carried, own)
