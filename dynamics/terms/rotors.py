"""`Rotors`: the term of the motors' polar inertias, including their effect on the links."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.arrays import FloatArray, IntArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain
from dynamics.kernels.gradients import pull_back, weights_of
from dynamics.kernels.rigid_body import RotorArrays, fill_rotors
from dynamics.kernels.threads import run_in_ranges
from dynamics.terms.motion import TermMotion


@dataclass(frozen=True, eq=False)
class Rotors:
    """Polar inertias of the rotors, `Im{i}` for the motor of joint i (theory: section 3).

    A rotor has the polar inertia I_M and turns about the unit vector e on the link that carries it,
    mu times as fast as its joint (in a coupled wrist: as its actuator, link side). Its mass, its
    transverse inertia and I_M e e^T are included in the parameters of that link. Two effects
    remain: the moment I_M mu (q'' e + q' w x e) on that link, and the torque I_M (mu^2 q'' + mu e .
    w') on the joint's actuator. Here w is the angular velocity of the link, and q the coordinate of
    the actuator, which in a coupled wrist differs from that of the joint. Only the moment on the
    link acts on the base.

    Attributes:
        chain: The arm.
        joint: Shape (rotors,). Index of the joint that each rotor drives, from 0.
        link: Shape (rotors,). Number of the link that carries each rotor; 0 is the base.
        axis: Shape (rotors, 3). Unit vector e of each rotor's axis, in the frame of the link that
            carries it.
        ratio: Shape (rotors,). mu, the speed of each rotor relative to that link, divided by the
            speed of its actuator at the link side [1, or rad/m].

    Raises:
        EstimationError: The arrays have different lengths, or a link cannot carry its rotor.
    """

    chain: Chain
    joint: IntArray
    link: IntArray
    axis: FloatArray
    ratio: FloatArray

    through_gears = False
    inertial = True
    name = "rotors"

    def __post_init__(self) -> None:
        arrays = (self.joint, self.link, self.axis, self.ratio)
        count = len(self.joint)
        if [array.shape for array in arrays] != [(count,), (count,), (count, 3), (count,)]:
            raise EstimationError(
                "joint, link, axis and ratio must have one entry per rotor", code="RID-API-ARGUMENT"
            )
        if np.any((self.link < 0) | (self.link > self.joint + 1) | (self.joint >= self.chain.n)):
            raise EstimationError(
                f"rotors of joints {self.joint} (from 0) are on links {self.link}: a rotor must"
                " be on the base (0), on a link before its joint, or on the link that it moves",
                code="RID-ROBOT-VALUE",
            )
        for array in arrays:
            array.setflags(write=False)

    @classmethod
    def from_description(cls, robot: RobotDescription) -> Rotors:
        """Return the rotors of a robot's joints, in the order of the joints."""
        driven = [(j, joint) for j, joint in enumerate(robot.joints) if joint.rotor is not None]
        rotors = [joint.rotor for _, joint in driven if joint.rotor is not None]
        axis = np.array([rotor.axis for rotor in rotors], dtype=np.float64).reshape(-1, 3)
        return cls(
            chain=Chain.from_description(robot),
            joint=np.array([j for j, _ in driven], dtype=np.int64),
            link=np.array([rotor.link for rotor in rotors], dtype=np.int64),
            axis=axis / np.linalg.norm(axis, axis=1, keepdims=True),
            ratio=np.array([joint.gear_ratio for _, joint in driven], dtype=np.float64),
        )

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters, one per rotor."""
        return tuple(f"Im{j + 1}" for j in self.joint)

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Units of the parameters, in the order of `parameter_names`."""
        return ("kg m^2",) * len(self.joint)

    def fill_torque(self, motion: TermMotion, out: FloatArray) -> None:
        """Compute the torque columns into `out`, (samples, n, rotors)."""
        self._fill(motion, False, out)
        motion.to_actuators(out)

    def fill_base_wrench(self, motion: TermMotion, out: FloatArray) -> None:
        """Compute the base wrench columns into `out`, (samples, 6, rotors)."""
        self._fill(motion, True, out)

    def torque_gradient(self, motion: TermMotion, weights: FloatArray) -> FloatArray:
        """Return the gradient of weighted sums of torque columns by the motion; see `Term`."""
        by_joint = np.zeros((len(weights), *motion.joint.shape))
        by_actuator = np.zeros_like(by_joint)
        weights = weights_of(motion.to_joints(weights))
        unweighted = np.broadcast_to(0.0, (*weights.shape[:3], 1))
        rotors = self._arrays(motion)

        def pull(first: int, last: int) -> None:
            pull_back(
                self.chain.arrays,
                rotors,
                (motion.joint, motion.actuator),
                self.chain.n,
                (unweighted, weights),
                (by_joint, by_actuator),
                first,
                last,
            )

        run_in_ranges(motion.joint.shape[1], pull)
        return by_joint + motion.by_joints(by_actuator)

    def _arrays(self, motion: TermMotion) -> RotorArrays:
        own = np.eye(self.chain.n)
        if motion.coupling is not None:
            own = np.ascontiguousarray(motion.coupling.motors_by_joints.T)
        return self.joint, self.link, self.axis, self.ratio, own

    def _fill(self, motion: TermMotion, of_base: bool, out: FloatArray) -> None:
        chain, rotors = self.chain.arrays, self._arrays(motion)

        def fill(first: int, last: int) -> None:
            fill_rotors(chain, rotors, motion.joint, motion.actuator, of_base, out, first, last)

        run_in_ranges(len(out), fill)
