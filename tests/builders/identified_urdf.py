"""A URDF, and the estimate of an arm whose bodies differ from it; Pinocchio simulates the arm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from config.arrays import FloatArray
from config.formats.urdf_file import read_urdf
from config.robot.urdf_chain import held_positions
from config.robot.urdf_robot import robot_of_urdf
from dynamics.model.robot_model import regressor
from identification.estimation.estimate import Estimate
from identification.export.model import ExportModel
from identification.export.urdf_arm import match_arm
from identification.model.base_parameters import base_parameters
from identification.model.options import ModelOptions

HEAVIER = 1.3
ARMATURE_KG_M2 = 0.05
FRICTION = 0.7
DAMPING = 0.4
NOISE = 1e-3


@dataclass(frozen=True)
class IdentifiedUrdf:
    """A URDF, the true arm in Pinocchio, and the estimate of the true arm.

    Attributes:
        data: The URDF's bytes.
        estimate: Base parameters fitted to the torques of Pinocchio.
        truth: The true arm: heavier links with other centres, with armatures.
        held: Positions of the URDF's other joints by name [rad or m].
    """

    data: bytes
    estimate: Estimate
    truth: pin.Model
    held: dict[str, float]

    def arm_of(self, data: bytes) -> pin.Model:
        """Return the arm of a URDF as Pinocchio reads it, with the armatures of the true arm."""
        names = self.estimate.robot.joint_names
        found = arm_of(data, names, self.held)
        found.armature = np.array(self.truth.armature)
        return found


def identified_urdf(data: bytes, tip: str | None = None) -> IdentifiedUrdf:
    """Return a URDF, a true arm that differs from it, and an estimate from the true arm's torques.

    The true arm has heavier links with other centres of mass, armatures and friction.
    """
    tree = read_urdf(data, "arm.urdf", literal_angles=True)
    robot = robot_of_urdf(tree, tip=tip).robot
    options = ModelOptions()
    probe = ModelOptions(rotors=False).build(robot)
    zero = ExportModel(robot, probe, np.zeros(len(probe.parameter_names)))
    held = held_positions(tree, match_arm(tree, zero, tip).arm)
    truth = _heavier(arm_of(data, robot.joint_names, held))
    q, v, a = random_motion(len(robot.joints))
    torques = rnea(truth, q, v, a) + FRICTION * np.sign(v) + DAMPING * v
    base = base_parameters(options.build(robot))
    columns = base.columns(regressor(options.build(robot), q, v, a))
    rows = columns.reshape(-1, len(base))
    values = np.asarray(np.linalg.lstsq(rows, torques.ravel(), rcond=None)[0], np.float64)
    covariance = np.diag((NOISE * np.abs(values) + 1e-5) ** 2)
    n = len(robot.joints)
    estimate = Estimate(
        robot=robot,
        options=options,
        base=base,
        values=values,
        covariance_noise=None,
        covariance_residual=covariance,
        covariance_jackknife=covariance,
        condition_number=30.0,
        equations=torques.size,
        residual_nm=np.full(n, 1e-3),
        noise_nm=None,
        left_out_fraction=np.zeros(n),
        method="smoothed",
        band_hz=10.0,
        standstill_rad_s=0.02,
    )
    return IdentifiedUrdf(data, estimate, truth, held)


def arm_of(data: bytes, joints: tuple[str, ...], held: dict[str, float]) -> pin.Model:
    """Return an arm with the named joints in Pinocchio.

    The other joints are fixed at the positions `held` [rad or m], or else at their neutral ones.
    """
    whole = pin.buildModelFromXML(data.decode())
    q = pin.neutral(whole)
    for name, position in held.items():
        joint = whole.joints[whole.getJointId(name)]
        if joint.nq == 1:
            q[joint.idx_q] = position
        else:  # a continuous joint
            q[joint.idx_q : joint.idx_q + 2] = np.cos(position), np.sin(position)
    others = [whole.getJointId(name) for name in list(whole.names)[1:] if name not in joints]
    return pin.buildReducedModel(whole, others, q)


def rnea(model: pin.Model, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """Return the torques of Pinocchio without friction [N m], (samples, joints).

    They include the armatures of the model.
    """
    data = model.createData()
    samples = zip(q, v, a, strict=True)
    return np.array([pin.rnea(model, data, _configuration(model, q), v, a) for q, v, a in samples])


def random_motion(n: int, samples: int = 400) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return random positions, velocities and accelerations in SI units, (samples, n) each."""
    random = np.random.default_rng(5)
    q, v, a = (random.uniform(-1.0, 1.0, (samples, n)) for _ in range(3))
    return q, 2.0 * v, 5.0 * a


def _configuration(model: pin.Model, q: FloatArray) -> FloatArray:
    parts = [
        np.array([position]) if joint.nq == 1 else np.array([np.cos(position), np.sin(position)])
        for joint, position in zip(list(model.joints)[1:], q, strict=True)
    ]
    return np.concatenate(parts)


def _heavier(model: pin.Model) -> pin.Model:
    """Give each body more mass, another centre and more inertia, and each joint an armature."""
    random = np.random.default_rng(1)
    for number in range(1, model.njoints):
        body = model.inertias[number]
        mass = max(HEAVIER * body.mass, 0.1)
        shift = 0.02 * random.uniform(-1.0, 1.0, 3)
        model.inertias[number] = pin.Inertia(
            mass, body.lever + shift, HEAVIER * body.inertia + 1e-3 * mass * np.eye(3)
        )
    model.armature = np.full(model.nv, ARMATURE_KG_M2)
    return model
