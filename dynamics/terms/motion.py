"""`TermMotion`: positions, velocities and accelerations, in the form that terms use."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.wrist_coupling import WristCoupling
from dynamics.terms.conditions import Conditions


@dataclass(frozen=True, eq=False)
class TermMotion:
    """A motion in joint and in actuator coordinates, and its conditions.

    Attributes:
        joint: Shape (3, samples, n). Positions q, velocities v and accelerations a of the joints
            [rad or m, per s, per s^2].
        actuator: Shape (3, samples, n). Positions alpha, velocities and accelerations of the
            actuators, link side, with q = C alpha (5.18). If the robot has no coupling, this is the
            same array as `joint`.
        coupling: Matrix C and its inverse; None if each actuator moves only its own joint.
        conditions: Temperature, load, payload, and presliding hysteresis.
    """

    joint: FloatArray
    actuator: FloatArray
    coupling: WristCoupling | None = None
    conditions: Conditions = field(default_factory=Conditions)

    @classmethod
    def of(
        cls,
        q: npt.ArrayLike,
        v: npt.ArrayLike,
        a: npt.ArrayLike,
        joints: int,
        coupling: WristCoupling | None = None,
        conditions: Conditions | None = None,
    ) -> TermMotion:
        """Return a motion with copies of q, v and a, each of shape (samples, n).

        Raises:
            EstimationError: The shapes do not fit each other or the robot.
        """
        shapes = [np.shape(x) for x in (q, v, a)]
        expected = (*shapes[0][:1], joints)
        if shapes != [expected] * 3:
            raise EstimationError(
                f"q, v and a must all have the shape (samples, {joints}), got"
                f" {', '.join(map(str, shapes))}",
                code="RID-API-ARGUMENT",
            )
        conditions = conditions or Conditions()
        for name, shapes in (
            ("temperature_k", [expected, (joints,)]),
            ("load_nm", [expected]),
        ):
            values = getattr(conditions, name)
            if values is not None and np.shape(values) not in shapes:
                raise EstimationError(
                    f"{name} has the shape {np.shape(values)}, but the motion has {expected}",
                    code="RID-API-ARGUMENT",
                )
        if conditions.memory is not None and len(conditions.memory.direction) != expected[0]:
            raise EstimationError(
                f"memory has {len(conditions.memory.direction)} samples, but the motion has"
                f" {expected[0]}",
                code="RID-API-ARGUMENT",
            )
        joint = np.array((q, v, a), dtype=np.float64)
        if coupling is None:
            return cls(joint, joint, None, conditions)
        actuator = np.array(coupling.to_motors(joint), order="C")
        return cls(joint, actuator, coupling, conditions)

    def part(self, samples: slice) -> TermMotion:
        """Return the motion for a range of samples."""
        joint = np.ascontiguousarray(self.joint[:, samples])
        actuator = joint
        if self.coupling is not None:
            actuator = np.ascontiguousarray(self.actuator[:, samples])
        return TermMotion(joint, actuator, self.coupling, self.conditions.part(samples))

    def to_actuators(self, rows: FloatArray) -> None:
        """Convert joint torques (samples, n, any) to actuator torques C^T tau (5.19), in place."""
        if self.coupling is None:
            return
        mixed = self.coupling.joints_by_motors - np.eye(rows.shape[1])
        before = {j: rows[:, j].copy() for j in np.flatnonzero(mixed.any(axis=1))}
        for j, i in zip(*np.nonzero(mixed), strict=True):
            rows[:, i] += mixed[j, i] * before[j]

    def to_joints(self, weights: FloatArray) -> FloatArray:
        """Convert weights (any, samples, n, any) of actuator torques to those of joint torques."""
        if self.coupling is not None:
            weights = np.einsum("ji,rsip->rsjp", self.coupling.joints_by_motors, weights)
        return weights

    def by_joints(self, by_actuators: FloatArray) -> FloatArray:
        """Convert derivatives (..., n) by actuator coordinates to those by joint coordinates."""
        if self.coupling is not None:
            by_actuators = by_actuators @ self.coupling.motors_by_joints
        return by_actuators
