"""`Deflection`: the tool error caused by elastic gears, which motor encoders cannot see.

A gear of stiffness k that transmits the torque tau deflects by tau/k. Encoders at the motors do not
measure this angle. Without a model, tau is taken from the measured motor torques. These contain
friction and the torque for the motors' own inertia, which the gear does not transmit. An identified
model gives tau without these two parts. Backlash, and deflection of links and bearings, are not
included.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from compensation.ramped_load import RampedLoad, evaluate_over
from config.arrays import BoolArray, FloatArray, freeze
from config.errors import DataQualityError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import convert_to_joints
from dynamics.geometry.kinematics import Chain, forward
from identification.choices import BAND_HZ
from identification.elasticity.transmitted_torque import transmitted_torque
from identification.equations.deconvolution import smoothed_recording
from identification.estimation.estimate import Estimate


@dataclass(frozen=True, eq=False)
class Deflection:
    """Estimated deflection of the gears with known stiffness, over a motion.

    Attributes:
        joint: Shape (samples, n). Deflection of each gear [rad or m]; 0 for gears of unknown
            stiffness.
        distance_m: Shape (samples,). Distance between the tool points with and without this
            deflection.
        known: Shape (n,). True for gears with known stiffness.
        tool_error_m: Shape (samples,). Distance between the estimated tool point and the desired
            one at the same instant; None if the desired positions are not known.
    """

    joint: FloatArray
    distance_m: FloatArray
    known: BoolArray
    tool_error_m: FloatArray | None = None

    def __post_init__(self) -> None:
        freeze(self, DataQualityError, (None, None), "joint")
        freeze(self, DataQualityError, (len(self.joint),), "distance_m", "tool_error_m")
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
    robot: RobotDescription,
    position: FloatArray,
    torque_nm: FloatArray,
    wanted: FloatArray | None = None,
) -> Deflection | None:
    """Estimate the tool error caused by gear deflection; return None if no stiffness is known.

    Args:
        robot: Kinematics and `stiffness_nm_rad`. With a coupled wrist each stiffness is that of the
            actuator's gear, at the gear's output.
        position: Shape (samples, n). Joint positions measured by the motor encoders [rad or m].
        torque_nm: Shape (samples, n). Torques of the actuators, or those that their gears transmit,
            at the gear outputs [N m or N].
        wanted: Shape (samples, n). Desired positions of the links, for the error of the tool.
    """
    stiffness = [joint.stiffness_nm_rad for joint in robot.joints]
    known = np.array([each is not None for each in stiffness])
    if not known.any():
        return None
    compliance = np.array([0.0 if each is None else 1.0 / each for each in stiffness])
    bent = convert_to_joints(robot, torque_nm * compliance)
    chain = Chain.from_description(robot)
    tool = forward(chain, position - bent)
    moved = np.asarray(np.linalg.norm(tool - forward(chain, position), axis=1))
    off = None
    if wanted is not None:
        off = np.asarray(np.linalg.norm(tool - forward(chain, wanted), axis=1))
    return Deflection(bent, moved, known, off)


def transmitted_torques(
    estimate: Estimate | RampedLoad, robot: RobotDescription, recording: Recording
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the positions of a motion's main phase and the torques that the gears transmit.

    See `transmitted_torque`. A payload outside the model is not included.

    Args:
        estimate: The identified robot, with the loads of the motion.
        robot: Robot file with the motors' inertias.
        recording: A run with its approach.

    Returns:
        `time_s`, shape (samples,). Times of the rows [s].
        `position, torque_nm`, shape (samples, n). Positions, low-passed [rad or m], and torques at
        the gears' outputs [N m or N].

    Raises:
        DataQualityError: The recording is too short or has too many gaps to compute accelerations.
    """
    signals = smoothed_recording(recording, BAND_HZ)
    main_s = recording.time_s[recording.phase == Phase.MAIN]
    rows = (signals.time_s >= main_s[0]) & (signals.time_s <= main_s[-1])
    if not rows.any():
        raise DataQualityError(
            f"every row of the motion is within {2.0 / BAND_HZ:g} s of an end or a gap of the"
            " recording, so accelerations cannot be computed: leave the model out",
            code="RID-RECORDING-SHORT",
        )
    motion = (signals.position[rows], signals.velocity[rows], signals.acceleration[rows])
    time_s = signals.time_s[rows]
    begin_s = _first_row_s(recording) if isinstance(estimate, RampedLoad) else 0.0
    torque_nm = evaluate_over(
        estimate, time_s - begin_s, lambda model: transmitted_torque(model, robot, *motion)
    )
    return time_s, motion[0], torque_nm


def _first_row_s(recording: Recording) -> float:
    """Return the time of the motion's first row in a run [s].

    A streamed path rests at its first point for one more cycle. Therefore the time is computed from
    the first row after this point.
    """
    first = int(np.argmax(recording.sample_index > 0))
    assert recording.sample_period_s is not None
    row = int(recording.sample_index[first])
    return float(recording.time_s[first]) - row * recording.sample_period_s
