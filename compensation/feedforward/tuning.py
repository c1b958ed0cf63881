"""Tuning of the feedforward by one averaged reference run: a torque scale and a delay per motor.

Model, loops and transport delay were measured separately; the closed loop shows the combined effect
of their errors. K_v is the gain of the position loop, v_ff the feedforward, R the transmission of
commands, and G_c the velocity loop. q is the measured motion, e the tracking error, s the torque
scale and T the delay. For the mean period of the reference run,

    R exp(-jw T) (K_v e + v_ff) - jw q = s G_c^-1 tau(q)

holds at every bin, with the bin's angular frequency w. Least squares give s and T (chapter 6.4
tunes the same two values).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.motion.samples import MotionSamples
from acquisition.signals.bins import differentiate_on_bins, to_bins
from compensation.feedforward.inverse import FeedforwardTuning, inverse_response
from compensation.feedforward.repeated_error import RepeatedError
from compensation.loops.multisine_spectra import interpolation_response
from compensation.loops.velocity_loop import VelocityLoop
from config.arrays import FloatArray, freeze
from config.errors import DataQualityError
from config.robot.wrist_coupling import convert_to_joints, convert_to_motors
from dynamics.model.memory import with_presliding_history
from identification.estimation.estimate import Estimate, predict

Complex = NDArray[np.complex128]

BAND_HZ: Final = 10.0
FEWEST_LINES: Final = 8
STEPS: Final = 8
WORST_SCALE_STD: Final = 0.05
LARGEST_CHANGE: Final = 0.5
SIGMAS: Final = 2.0


@dataclass(frozen=True, eq=False)
class Tuning:
    """A tuning with its uncertainty.

    Attributes:
        tuning: Values to use: scale 1 or delay 0 if the run shows no significant difference from
            it, or does not excite the axis enough.
        scale, delay_s: Shape (n,). Estimated values.
        scale_std, delay_std_s: Shape (n,). Standard deviations, from the residuals.
        used: True for axes that the run excites enough.
    """

    tuning: FeedforwardTuning
    scale: FloatArray
    delay_s: FloatArray
    scale_std: FloatArray
    delay_std_s: FloatArray
    used: tuple[bool, ...]

    def __post_init__(self) -> None:
        freeze(self, DataQualityError, (None,), "scale", "delay_s", "scale_std", "delay_std_s")


def tune(
    samples: MotionSamples,
    measured: RepeatedError,
    estimate: Estimate,
    loops: Sequence[VelocityLoop],
    gain_per_s: float,
) -> Tuning:
    """Return scale and delay of each motor from the mean period of a reference run.

    Args:
        samples: The reference motion with the feedforward of its run.
        measured: Mean tracking error of the run.
        estimate: Model of the robot.
        loops: Velocity loops, one per motor, base to flange.
        gain_per_s: K_v of the position loop [1/s].

    Raises:
        DataQualityError: The motion is not periodic or too short, or the run contradicts the model
            or the loops.
    """
    if not measured.periodic:
        raise DataQualityError(
            "the reference run is not periodic and cannot be averaged: record a circle or another"
            " periodic motion",
            code="RID-RECORDING-NOT-PERIODIC",
        )
    step_s, rows = samples.sample_period_s, measured.rows
    count = len(measured.error)
    highest = min(math.floor(BAND_HZ * count * step_s), (count - 1) // 2)
    if highest < FEWEST_LINES:
        raise DataQualityError(
            f"the period of the reference run has {highest} harmonics up to {BAND_HZ:g} Hz, but"
            f" {FEWEST_LINES} are needed: record a motion with a longer period",
            code="RID-MOTION-PERIOD",
        )
    ahead = samples.velocity if samples.feedforward is None else samples.feedforward
    robot = estimate.robot
    wanted = convert_to_motors(robot, samples.position[rows])
    reached = differentiate_on_bins(wanted - measured.error, step_s, highest)
    position, velocity, acceleration = (convert_to_joints(robot, values) for values in reached)
    before = with_presliding_history(estimate.model, position, periodic=True)
    predicted = predict(estimate, position, velocity, acceleration, before)
    torque = to_bins(predicted, highest)[1:]
    ahead = convert_to_motors(robot, ahead[rows])
    sent = to_bins(gain_per_s * measured.error + ahead, highest)[1:]
    speed = to_bins(reached.velocity, highest)[1:]
    frequency_hz = np.arange(1, highest + 1) / (count * step_s)
    omega = 2.0 * math.pi * frequency_hz
    reach = interpolation_response(frequency_hz, step_s)
    n = len(loops)
    found, std = np.empty((2, n)), np.empty((2, n))
    for j, loop in enumerate(loops):
        x = np.array([1.0, 0.0])
        needed = inverse_response(loop, frequency_hz) * torque[:, j]
        a, b = _equations(x, needed, reach * sent[:, j], speed[:, j], omega)
        for _ in range(STEPS):
            x = np.asarray(x + np.linalg.lstsq(a, b, rcond=None)[0], dtype=np.float64)
            a, b = _equations(x, needed, reach * sent[:, j], speed[:, j], omega)
        covariance = np.linalg.inv(a.T @ a) * float(b @ b) / (len(b) - 2)
        found[:, j], std[:, j] = x, np.sqrt(np.diagonal(covariance))
    used = std[0] < WORST_SCALE_STD
    if (np.abs(found[0] - 1.0)[used] > LARGEST_CHANGE).any():
        worst = int(np.argmax(np.abs(found[0] - 1.0) * used))
        raise DataQualityError(
            f"the reference run needs {found[0, worst]:.3g} times the model torque of"
            f" {loops[worst].joint_name}: the model or the velocity loops belong to another"
            " robot or payload; measure the loops and identify the model again",
            code="RID-LOOP-OTHER",
        )
    significant = used & (np.abs(found - [[1.0], [0.0]]) > SIGMAS * std)
    chosen = FeedforwardTuning(
        np.where(significant[0], found[0], 1.0), np.where(significant[1], found[1], 0.0)
    )
    return Tuning(chosen, found[0], found[1], std[0], std[1], tuple(used.tolist()))


def _equations(
    x: FloatArray, needed: Complex, sent: Complex, speed: Complex, omega: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the linearised equations for scale and delay, and the residual on each bin."""
    arrives = np.exp(-1j * omega * x[1]) * sent
    missing = arrives - speed - x[0] * needed
    columns = np.stack([needed, 1j * omega * arrives], axis=1)
    return (
        np.concatenate([columns.real, columns.imag]),
        np.concatenate([missing.real, missing.imag]),
    )
