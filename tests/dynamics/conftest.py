"""Fixtures: random arms, and Pinocchio models built from the same descriptions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from config.load import load_robot
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription, Rotor

X, Y, Z = np.eye(3)
# Pinocchio: Ixx Ixy Iyy Ixz Iyz Izz; rid-daq: Ixx Ixy Ixz Iyy Iyz Izz
PINOCCHIO_ORDER = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]


def turn(axis: np.ndarray, angle: float) -> pin.SE3:
    return pin.SE3(pin.AngleAxis(angle, axis).toRotationMatrix(), np.zeros(3))


def shift(x: float, y: float, z: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, z]))


@dataclass(frozen=True)
class Judge:
    """Pinocchio model of an arm; each rotor is a body on a separate joint.

    Torques refer to the arm's joints, even if a rotor is coupled to several joints.
    """

    model: Any
    joints: int
    spread: np.ndarray  # (nv, n): maps joint velocities to the velocities of joints and rotors

    def _all_coordinates(self, *motion: np.ndarray) -> list[np.ndarray]:
        return [self.spread @ x for x in motion]

    def frames(self, q: np.ndarray) -> np.ndarray:
        data = self.model.createData()
        pin.forwardKinematics(self.model, data, *self._all_coordinates(q))
        return np.array([data.oMi[i + 1].homogeneous for i in range(self.joints)])

    def regressor(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        data = self.model.createData()
        columns = pin.computeJointTorqueRegressor(self.model, data, q, v, a)
        return columns.reshape(self.joints, -1, 10)[..., PINOCCHIO_ORDER].reshape(self.joints, -1)

    def torque(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        data = self.model.createData()
        return self.spread.T @ pin.rnea(self.model, data, *self._all_coordinates(q, v, a))

    def base_wrench(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        data = self.model.createData()
        pin.rnea(self.model, data, *self._all_coordinates(q, v, a))
        pin.updateGlobalPlacements(self.model, data)
        on_base = [i for i in range(1, self.model.njoints) if self.model.parents[i] == 0]
        return sum((data.oMi[i].act(data.f[i]) for i in on_base), pin.Force.Zero()).vector


@pytest.fixture
def random_arm() -> Callable[..., RobotDescription]:
    """Return a function that makes a description of n joints, with rotors on random links."""

    def make(n: int, seed: int, kinds: str | None = None) -> RobotDescription:
        rng = np.random.default_rng(seed)
        kinds = kinds or "".join(rng.choice(["R", "R", "P"], n))
        limits = JointLimits(
            position_min=-3.0, position_max=3.0, velocity=3.0, acceleration=9.0, torque=99.0
        )

        def rotor(joint: int) -> Rotor:
            axis = rng.standard_normal(3)
            axis /= np.linalg.norm(axis)
            return Rotor(link=int(rng.integers(0, joint + 2)), axis=tuple(axis.tolist()))

        return RobotDescription(
            name="random",
            gravity_m_s2=tuple(rng.uniform(-10.0, 10.0, 3).tolist()),
            kinematics=Kinematics(
                convention="modified_dh",
                rows=tuple(
                    KinematicRow(
                        alpha_rad=rng.uniform(-3, 3),
                        beta_rad=rng.uniform(-0.3, 0.3),
                        theta_rad=rng.uniform(-3, 3),
                        a_m=rng.uniform(-0.5, 0.5),
                        d_m=rng.uniform(-0.5, 0.5),
                    )
                    for _ in range(n)
                ),
            ),
            tool_offset_m=tuple(rng.uniform(-0.3, 0.3, 3).tolist()),
            joints=tuple(
                Joint(
                    name=f"j{i + 1}",
                    type="prismatic" if kind == "P" else "revolute",
                    limits=limits,
                    gear_ratio=float(rng.choice([-1, 1]) * rng.uniform(5.0, 20.0)),
                    rotor=rotor(i),
                )
                for i, kind in enumerate(kinds)
            ),
        )

    return make


@pytest.fixture
def judge() -> Callable[..., Judge]:
    """Return a function that makes the Pinocchio model of a description from link parameters.

    `rotors` are placements and inertias of bodies that spin about the axes in the description. Each
    inertia is about the rotor's centre, in the axes of its link. With None there are no rotors.
    """

    def make(
        robot: RobotDescription,
        links: np.ndarray,
        rotors: list[tuple[pin.SE3, pin.Inertia]] | None = None,
    ) -> Judge:
        model = pin.Model()
        model.gravity.linear = np.array(robot.gravity_m_s2)
        parent = 0
        for joint, row, ten in zip(robot.joints, robot.kinematics.rows, links, strict=True):
            placement = (
                turn(X, row.alpha_rad)
                * shift(row.a_m, 0, 0)
                * turn(Y, row.beta_rad)
                * turn(Z, row.theta_rad)
                * shift(0, 0, row.d_m)
            )
            kind = pin.JointModelPZ() if joint.type == "prismatic" else pin.JointModelRZ()
            parent = model.addJoint(parent, kind, placement, joint.name)
            order = np.argsort(PINOCCHIO_ORDER)
            inertia = pin.Inertia.FromDynamicParameters(ten[order])
            model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
        n = model.nv
        for joint, (placement, inertia) in zip(robot.joints, rotors or [], strict=bool(rotors)):
            assert joint.rotor is not None
            kind = pin.JointModelRevoluteUnaligned(np.array(joint.rotor.axis))
            body = model.addJoint(joint.rotor.link, kind, placement, f"{joint.name}_rotor")
            model.appendBodyToJoint(body, inertia, pin.SE3.Identity())
        ratios = np.diag([joint.gear_ratio for joint in robot.joints])
        if robot.coupling is not None:
            ratios = ratios @ np.linalg.inv(robot.coupling)
        spread = np.vstack([np.eye(n), ratios]) if rotors else np.eye(n)
        return Judge(model, n, spread)

    return make


@pytest.fixture
def random_motion() -> Callable[[int, int], np.ndarray]:
    """Return a function that makes q, v, a of 8 random samples, (3, 8, n)."""
    return lambda n, seed: np.random.default_rng(seed).uniform(-2.0, 2.0, (3, 8, n))


@pytest.fixture
def random_links() -> Callable[[int, int], np.ndarray]:
    """Return a function that makes the parameters of n physically consistent bodies, (n, 10)."""

    def make(n: int, seed: int) -> np.ndarray:
        rng = np.random.default_rng(seed)

        def body() -> np.ndarray:
            root = rng.standard_normal((3, 3))
            about_centre = np.trace(root @ root.T) * np.eye(3) - root @ root.T
            inertia = pin.Inertia(rng.uniform(1.0, 20.0), rng.uniform(-0.3, 0.3, 3), about_centre)
            return inertia.toDynamicParameters()[PINOCCHIO_ORDER]

        return np.array([body() for _ in range(n)])

    return make


@pytest.fixture
def ir361() -> RobotDescription:
    return load_robot("ir361")
