"""`GravitySearch`: search for the gravity direction, in the base's frame, that fits torques best.

A regressor is linear in gravity's vector. Products of columns are computed once for the part
without gravity and for one part per axis of the base. The equations for any direction are sums of
these products.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain
from dynamics.model.robot_model import regressor
from identification.wiring.mistakes import Mistake, MistakeKind, robot_mistake
from identification.wiring.signals import WiredSignals
from identification.wiring.trial import CondensedEquations, plain_model, rows_used

DIRECTIONS: Final = 80
FINEST_RAD: Final = 1e-3
LEAST_TILT_RAD: Final = math.radians(5.0)


@dataclass(frozen=True, eq=False)
class GravitySearch:
    """Products of the four parts of the regressor, and of the torques.

    Attributes:
        signals: The signals and the robot as stated in the files.
        stated: Equations with the gravity of the robot file.
        products: Shape (n, 4 p + n, 4 p + n). Products as in `CondensedEquations`, for all four
            parts: columns without gravity, then those of 1 m/s^2 along x, y, and z.
    """

    signals: WiredSignals
    stated: CondensedEquations
    products: FloatArray

    @classmethod
    def of(cls, signals: WiredSignals, stated: CondensedEquations) -> GravitySearch:
        """Evaluate the regressor for gravity along each axis."""
        use = rows_used(signals)
        phis = []
        for gravity in (np.zeros(3), *np.eye(3)):
            turned = replace(signals, robot=_with_gravity(signals.robot, gravity))
            phis.append(regressor(plain_model(turned), *turned.joints()))
        parts = [phis[0], *(phi - phis[0] for phi in phis[1:])]
        products = []
        for j in range(use.shape[1]):
            columns = np.hstack([*(part[:, j] for part in parts), signals.torque_nm])
            columns *= use[:, j : j + 1]
            products.append(columns.T @ columns)
        return cls(signals, stated, np.array(products))

    def mistakes(self) -> Iterator[Mistake]:
        """Yield other directions of gravity: along axes of the base, and the best-fitting one."""
        stated = np.array(self.signals.robot.gravity_m_s2)
        size = float(np.linalg.norm(stated))
        for axis in (*np.eye(3), *-np.eye(3)):
            if stated @ axis < 0.99 * size:
                yield self._mistake(size * axis)
        if size == 0.0:
            return
        best = self._best(size)
        known = np.vstack([np.eye(3), -np.eye(3), stated / size])
        if (known @ best).max() < math.cos(LEAST_TILT_RAD) * size:
            yield self._mistake(best)

    def is_oblique(self, found: Mistake) -> bool:
        """Return True if a mistake is gravity that is not along an axis of the base."""
        robot = found.robot if found.kind is MistakeKind.MOUNTING else None
        return robot is not None and bool(np.count_nonzero(robot.gravity_m_s2) > 1)

    def is_turned(self, oblique: Mistake, other: Mistake) -> bool:
        """Return True if `oblique` is `other`, gravity along an axis, turned about the first joint.

        A wrong zero position of the first joint turns gravity about the axis of this joint.
        Therefore no data can distinguish an oblique base from a base mounted along an axis with a
        wrong zero position.
        """
        if other.kind is not MistakeKind.MOUNTING or self.is_oblique(other):
            return False
        chain = Chain.from_description(self.signals.robot)
        one, two = (np.array(each.robot.gravity_m_s2) for each in (oblique, other) if each.robot)
        reach = math.sin(LEAST_TILT_RAD) * float(np.linalg.norm(one))
        axis = chain.fixed_rotations[0][:, 2]
        return not chain.prismatic[0] and bool(abs(axis @ (two - one)) < reach)

    def without(self) -> CondensedEquations:
        """Return the equations of a robot without gravity."""
        return CondensedEquations.of(
            replace(self.signals, robot=_with_gravity(self.signals.robot, np.zeros(3)))
        )

    def _best(self, size: float) -> FloatArray:
        """Return the gravity vector of the lowest cost: the best of a grid, refined."""
        still = np.eye(len(self.signals.robot.joints))

        def cost(direction: FloatArray) -> float:
            return self._condense(size * direction).trial(still).cost

        best = min(_directions(), key=cost)
        lowest, step = cost(best), math.pi / math.sqrt(DIRECTIONS)
        while step > FINEST_RAD:
            along = np.linalg.svd(best[np.newaxis])[2][1:]  # two axes normal to `best`
            turned = [
                math.cos(step) * best + sign * math.sin(step) * axis
                for axis in along
                for sign in (1.0, -1.0)
            ]
            costs = [cost(each) for each in turned]
            least = int(np.argmin(costs))
            if costs[least] < lowest:
                best, lowest = turned[least], costs[least]
            else:
                step *= 0.5
        return size * best

    def _mistake(self, gravity: FloatArray) -> Mistake:
        return robot_mistake(MistakeKind.MOUNTING, (), _with_gravity(self.signals.robot, gravity))

    def _condense(self, gravity: FloatArray) -> CondensedEquations:
        """Return the equations with another gravity vector."""
        p, n = self.stated.brakes.shape[1], len(self.stated.rows)
        weights = np.array([1.0, *gravity])
        columns = self.products[:, : 4 * p, : 4 * p].reshape(n, 4, p, 4, p)
        cross = self.products[:, : 4 * p, 4 * p :].reshape(n, 4, p, n)
        products = np.empty((1, n, p + n, p + n))
        products[0, :, p:, p:] = self.products[:, 4 * p :, 4 * p :]
        products[0, :, :p, p:] = np.einsum("a,japk->jpk", weights, cross)
        products[0, :, p:, :p] = products[0, :, :p, p:].swapaxes(1, 2)
        of_one = np.einsum("a,japbq->jpbq", weights, columns)
        products[0, :, :p, :p] = np.einsum("b,jpbq->jpq", weights, of_one)
        return replace(self.stated, products=products, drawn_weight=None)


def _with_gravity(robot: RobotDescription, gravity: FloatArray) -> RobotDescription:
    return robot.model_copy(update={"gravity_m_s2": tuple(gravity.tolist())})


def _directions() -> list[FloatArray]:
    """Return directions distributed over the sphere, on a spiral."""
    height = 1.0 - (2.0 * np.arange(DIRECTIONS) + 1.0) / DIRECTIONS
    turn = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(DIRECTIONS)
    flat = np.sqrt(1.0 - height**2)
    return list(np.column_stack([flat * np.cos(turn), flat * np.sin(turn), height]))
