"""`MeasuredArm`: an elastic arm off its nominal geometry, whose point a tracker measures.

Pinocchio computes frames and torques of gravity. The geometry and the calibration of the project
are not used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]

from config.arrays import FloatArray
from config.robot.link_cad import LinkCad
from config.robot.robot import RobotDescription

ERRORS: Final = np.array([5e-4, 3e-4, 2e-3, 3e-4, 5e-4])
"""Standard deviations of the true rows: alpha, beta, theta [rad], a, d [m]."""
FRAME: Final = pin.SE3(pin.rpy.rpyToMatrix(0.02, -0.03, 0.9), np.array([2.1, -0.7, 0.4]))
IR361_LINKS: Final = (
    LinkCad(mass_kg=110.0, centre_m=(0.05, 0.02, -0.1)),
    LinkCad(mass_kg=36.0, centre_m=(0.2, 0.02, 0.03)),
    LinkCad(mass_kg=25.0, centre_m=(0.15, 0.02, 0.01)),
)
"""Invented bodies of ir361, whose robot file has no drawing data."""


@dataclass(frozen=True, eq=False)
class MeasuredArm:
    """The true arm.

    Attributes:
        robot: The nominal robot file, with drawing data of its links and without a spring.
        model: True kinematics and bodies.
        point_m: Shape (3,). The true point in the frame of the last link.
        compliance: Shape (n,). True compliance of the gears [rad/(N m)].
        coupling: Shape (n, n). C of q = C alpha.
        load_centre_m: Shape (3,). Centre of gravity of loads in the frame of the last link.
    """

    robot: RobotDescription
    model: Any
    point_m: FloatArray
    compliance: FloatArray
    coupling: FloatArray
    load_centre_m: FloatArray

    @classmethod
    def of(
        cls,
        robot: RobotDescription,
        nominal_point_m: FloatArray,
        stiffness: tuple[float, ...],
        seed: int,
    ) -> MeasuredArm:
        """Return an arm with random errors of geometry, point, stiffness (30 %) and bodies (1 %).

        Args:
            robot: The nominal robot. Links without drawing data get those of ir361.
            nominal_point_m: Shape (3,). Nominal point in the frame of the last link.
            stiffness: Nominal stiffness of each gear [N m/rad].
            seed: Random seed of the errors.
        """
        random = np.random.default_rng(seed)
        cad = robot.cad or IR361_LINKS
        nominal = robot.model_copy(update={"cad": cad, "spring": None})
        model = pin.Model()
        model.gravity.linear = np.array(robot.gravity_m_s2)
        parent = 0
        for row, link in zip(robot.kinematics.calibrated_rows, cad, strict=True):
            true = np.array([row.alpha_rad, row.beta_rad, row.theta_rad, row.a_m, row.d_m])
            alpha, beta, theta, a, d = true + ERRORS * random.normal(size=5)
            placement = (
                _turn(alpha, 0)
                * pin.SE3(np.eye(3), np.array([a, 0.0, 0.0]))
                * _turn(beta, 1)
                * _turn(theta, 2)
                * pin.SE3(np.eye(3), np.array([0.0, 0.0, d]))
            )
            parent = model.addJoint(parent, pin.JointModelRZ(), placement, f"joint{parent}")
            mass = link.mass_kg * (1.0 + 0.01 * random.uniform(-1.0, 1.0))
            body = pin.Inertia(mass, np.array(link.centre_m), np.eye(3))
            model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        n = len(cad)
        return cls(
            nominal,
            model,
            nominal_point_m + 3e-3 * random.normal(size=3),
            1.0 / (np.array(stiffness) * random.uniform(0.7, 1.3, n)),
            np.eye(n) if robot.coupling is None else np.array(robot.coupling),
            nominal_point_m,
        )

    def points(self, position: FloatArray, load_kg: FloatArray) -> FloatArray:
        """Return the point in the tracker's frame, without noise, (samples, 3) [m].

        Args:
            position: Shape (samples, n). Joint positions from the motors' encoders.
            load_kg: Shape (samples,). Mass at the flange.
        """
        return np.array(
            [self._point(pose, mass) for pose, mass in zip(position, load_kg, strict=True)]
        )

    def _point(self, position: FloatArray, load_kg: float) -> FloatArray:
        model = self.model.copy()
        if load_kg:
            body = pin.Inertia(load_kg, self.load_centre_m, np.zeros((3, 3)))
            model.appendBodyToJoint(model.njoints - 1, body, pin.SE3.Identity())
        data = model.createData()
        links = position
        for _ in range(40):
            of_joints = pin.computeGeneralizedGravity(model, data, links)
            of_motors = self.coupling.T @ of_joints
            bent = position - self.coupling @ (self.compliance * of_motors)
            if np.abs(bent - links).max() < 1e-13:
                break
            links = bent
        pin.forwardKinematics(model, data, links)
        return np.asarray(FRAME.act(data.oMi[model.njoints - 1].act(self.point_m)))


def _turn(angle: float, axis: int) -> Any:
    return pin.SE3(pin.AngleAxis(angle, np.eye(3)[axis]).toRotationMatrix(), np.zeros(3))
