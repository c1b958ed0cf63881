"""`WristCoupling`: conversion between the joints of a coupled wrist and their motors (5.18).

All quantities of a drive are its motor's: counts, velocity, torque, the limit of the following
error. Positions and velocities of the program are the joints'. `CyclicExchange` converts them on
the bus, `Motion` in models. Measured torques are the motors'.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.robot.robot import RobotDescription

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class WristCoupling:
    """The matrix C of q = C alpha; alpha are the motors' angles divided by their gear ratios.

    Attributes:
        joints_by_motors: Shape (n, n). C.
        motors_by_joints: Shape (n, n). Its inverse.
        motors_of: For each joint, the motors that move it.
    """

    joints_by_motors: Array
    motors_by_joints: Array
    motors_of: tuple[tuple[int, ...], ...]

    @classmethod
    def of_robot(cls, robot: RobotDescription) -> WristCoupling | None:
        """Return the coupling of a robot; None if its file has no `coupling`."""
        if robot.coupling is None:
            return None
        return cls.of_matrix(np.array(robot.coupling))

    @classmethod
    def of_matrix(cls, matrix: Array) -> WristCoupling:
        """Return the coupling of a matrix C, (n, n)."""
        motors = tuple(tuple(np.flatnonzero(row).tolist()) for row in matrix)
        return cls(matrix, np.asarray(np.linalg.inv(matrix), dtype=np.float64), motors)

    def to_joints(self, of_motors: Array, out: Array) -> None:
        """Write the joints' positions or velocities into `out`, (n,), from the motors'."""
        np.matmul(self.joints_by_motors, of_motors, out=out)

    def to_motors(self, of_joints: Sequence[float] | Array) -> Array:
        """Return the motors' positions or velocities, (n,) or (samples, n), from the joints'."""
        return np.asarray(np.asarray(of_joints) @ self.motors_by_joints.T)


def convert_to_motors(robot: RobotDescription, of_joints: Array) -> Array:
    """Return the motors' positions, velocities or accelerations from the joints'.

    Args:
        robot: A robot; without a coupled wrist, the values stay unchanged.
        of_joints: Shape (samples, n). Values of the joints [rad or m, and per second].
    """
    coupling = WristCoupling.of_robot(robot)
    return of_joints if coupling is None else coupling.to_motors(of_joints)


def convert_to_joints(robot: RobotDescription, of_motors: Array) -> Array:
    """Return the joints' positions, velocities or accelerations from the motors'.

    Args:
        robot: A robot; without a coupled wrist, the values stay unchanged.
        of_motors: Shape (samples, n). Values of the motors, link side [rad or m, and per second].
    """
    coupling = WristCoupling.of_robot(robot)
    return of_motors if coupling is None else np.asarray(of_motors @ coupling.joints_by_motors.T)


def motor_ranges(robot: RobotDescription) -> list[tuple[float, float]]:
    """Return the lowest and highest position of each motor divided by its gear ratio [rad or m].

    The ranges follow from the joints' position limits. With a coupled wrist they are the range of
    alpha = C^-1 q (5.18) over the box of these limits.
    """
    limits = [joint.limits for joint in robot.joints]
    low = np.array([each.position_min for each in limits])
    high = np.array([each.position_max for each in limits])
    coupling = WristCoupling.of_robot(robot)
    if coupling is not None:
        to_motors = coupling.motors_by_joints
        rising, falling = np.maximum(to_motors, 0.0), np.minimum(to_motors, 0.0)
        low, high = rising @ low + falling @ high, rising @ high + falling @ low
    return list(zip(low.tolist(), high.tolist(), strict=True))
