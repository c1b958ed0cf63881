"""`Deflection`: how far gears bend the tool away from where the motors' encoders see it.

Encoders at the motors do not see the angle tau/k by which a gear of stiffness k gives way under
the torque tau that it transmits. The estimate takes the measured motor torques for tau: friction
and the motors' own inertia are part of them, although the gear does not transmit them. Play, and
bending of links and bearings, are not part of the estimate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.arrays import BoolArray, FloatArray, freeze
from config.errors import DataQualityError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling
from dynamics.geometry.kinematics import Chain, forward


@dataclass(frozen=True, eq=False)
class Deflection:
    """Estimated bending of the gears whose stiffness is known, over a motion.

    Attributes
    ----------
    joint : ndarray, shape (samples, n)
        Angle that each gear gives way by [rad or m]; 0 for gears of unknown stiffness.
    distance_m : ndarray, shape (samples,)
        Distance between the tool point with and without this bending.
    known : ndarray of bool, shape (n,)
        The gears whose stiffness is known.
    """

    joint: FloatArray
    distance_m: FloatArray
    known: BoolArray

    def __post_init__(self) -> None:
        freeze(self, DataQualityError, (None, None), "joint")
        freeze(self, DataQualityError, (len(self.joint),), "distance_m")
        freeze(self, DataQualityError, (self.joint.shape[1],), "known", dtype=np.bool_)

    @property
    def rms_m(self) -> float:
        """RMS of the distance [m]."""
        return float(np.sqrt(np.mean(self.distance_m**2)))

    @property
    def max_m(self) -> float:
        """Largest distance [m]."""
        return float(self.distance_m.max())


def deflection(
    robot: RobotDescription, position: FloatArray, torque_nm: FloatArray
) -> Deflection | None:
    """Estimate how gears bend the tool; return None if no gear's stiffness is known.

    Parameters
    ----------
    robot : RobotDescription
        Kinematics and `stiffness_nm_rad`. With a coupled wrist each stiffness is that of the
        actuator's gear, at the gear's output.
    position : ndarray, shape (samples, n)
        Joint positions by the motors' encoders [rad or m].
    torque_nm : ndarray, shape (samples, n)
        Actuator torques at the gears' outputs [N m or N].
    """
    stiffness = [joint.stiffness_nm_rad for joint in robot.joints]
    known = np.array([each is not None for each in stiffness])
    if not known.any():
        return None
    compliance = np.array([0.0 if each is None else 1.0 / each for each in stiffness])
    bent = torque_nm * compliance
    coupling = WristCoupling.of_robot(robot)
    if coupling is not None:
        bent = bent @ coupling.joints_by_motors.T
    chain = Chain.from_description(robot)
    moved = forward(chain, position - bent) - forward(chain, position)
    return Deflection(bent, np.asarray(np.linalg.norm(moved, axis=1)), known)
