"""`TorqueGap`: torques of a robot description compared with those of the identified model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from dynamics.model.robot_model import torque
from dynamics.terms.conditions import Conditions
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.estimation.estimate import Estimate
from identification.export.model import ExportModel
from identification.model.options import ModelOptions

ROWS: Final = 2000


@dataclass(frozen=True, eq=False)
class TorqueGap:
    """Torques on random motions within the joints' limits, RMS by joint [N m or N], shape (n,).

    Attributes:
        model_nm: Torques of the identified model, without a payload.
        with_armature_nm: Differences from a description with straight friction and armatures.
        without_armature_nm: Differences from a description with straight friction only.
    """

    model_nm: FloatArray
    with_armature_nm: FloatArray
    without_armature_nm: FloatArray

    @classmethod
    def of(cls, estimate: Estimate, model: ExportModel) -> TorqueGap:
        """Compare an estimate with the content of a robot description.

        Positions are random in the range of the estimate's runs, or in the joints' limits if it is
        unknown; velocities and accelerations are random within their limits. Friction with
        presliding follows the sign of the velocity.

        Args:
            estimate: The identified model.
            model: The parameters that were written.
        """
        q, v, a = _motion(estimate)
        own = estimate.model
        cold = np.array([joint.reference_temperature_k for joint in estimate.robot.joints])
        conditions = Conditions(temperature_k=cold)
        identified = torque(own, q, v, a, estimate.standard_values, conditions)
        links = ModelOptions(rotors=False, friction=False, spring=False).build(estimate.robot)
        bodies = model.parameters[: PARAMETERS_PER_LINK * own.chain.n]
        alone = torque(links, q, v, a, bodies)
        armatures = np.zeros(own.chain.n)
        for j in range(own.chain.n):
            line = model.straight_friction(j)
            alone[:, j] += line.friction * np.sign(v[:, j]) + line.damping * v[:, j]
            armatures[j] = model.armature(j)
        return cls(
            _rms(identified), _rms(identified - alone - armatures * a), _rms(identified - alone)
        )


def _motion(estimate: Estimate) -> tuple[FloatArray, FloatArray, FloatArray]:
    limits = [joint.limits for joint in estimate.robot.joints]
    low_high = estimate.position_range
    if low_high is None:
        low_high = np.array([[one.position_min, one.position_max] for one in limits])
    speed = np.array([one.velocity for one in limits])
    acceleration = np.array([one.acceleration for one in limits])
    random = np.random.default_rng(0)
    shape = (ROWS, len(limits))
    return (
        random.uniform(low_high[:, 0], low_high[:, 1], shape),
        random.uniform(-speed, speed, shape),
        random.uniform(-acceleration, acceleration, shape),
    )


def _rms(values: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))
