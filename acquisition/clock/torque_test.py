"""Test of rebuilt times on the prediction of held-out torques.

One half of the recording identifies the rigid robot with friction and predicts the torques of the
other half, and vice versa. With a wrong clock the accelerations are wrong, and so the predicted
torques are wrong too. The friction model contains nonlinear terms of the speed, because real robots
have such friction. Without these terms the residuals would hide the error of the clock.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from acquisition.clock.samples import STANDSTILL_SPEED, Samples
from acquisition.motion.samples import Phase
from acquisition.processing.smoothing import smooth_nonperiodic
from acquisition.recording.recording import Recording
from config.arrays import FloatArray
from config.errors import RidDaqError
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription

FRICTION: Final[tuple[FrictionTerm, ...]] = (
    "coulomb", "viscous", "offset", "cubic", "cube_root",
)  # fmt: skip
BAND_HZ: Final = 8.0
GUARD_S: Final = 0.06
"""Time before and after a reversal from which no rows are used, because the low-pass blurs the sign
of the friction there [s]."""
MOST_ROWS: Final = 4000
PARTS: Final = 8
CONDITION: Final = 1e-6


def torque_gain(
    robot: RobotDescription, samples: Samples, time_s: FloatArray, coupling: FloatArray | None
) -> tuple[float, float] | None:
    """Return the reduction of the error of predicted held-out torques, and its standard error.

    Args:
        samples: Rows without repeats, with the stamps.
        time_s: Shape (rows,). Rebuilt times, which are compared with the stamps.
        coupling: Shape (n, n). Coupling matrix C in q = C alpha, if the positions are those of the
            actuators (alpha).

    Returns:
        Mean logarithm of a ratio, and its standard error. The ratio is the prediction error with
        the stamps divided by the prediction error with `time_s`. None if the torques cannot be
        predicted, for example because the recording is too short or its sampling rate too low.
    """
    try:
        by_stamps = _held_out_errors(robot, samples, samples.time_s, coupling)
        by_times = _held_out_errors(robot, samples, time_s, coupling)
    except (RidDaqError, np.linalg.LinAlgError):
        return None
    gains = 0.5 * np.log(by_stamps / by_times)
    gain = np.array(
        [float(part[np.isfinite(part)].mean()) for part in gains if _has_finite_value(part)]
    )
    if len(gain) < PARTS:
        return None
    return float(gain.mean()), float(gain.std(ddof=1)) / math.sqrt(len(gain))


def _held_out_errors(
    robot: RobotDescription, samples: Samples, time_s: FloatArray, coupling: FloatArray | None
) -> FloatArray:
    """Return the mean squared error of held-out torques, shape (2 * PARTS, joints)."""
    from scipy.ndimage import minimum_filter1d

    from dynamics.model.robot_model import RobotModel, regressor  # loads the compiler

    joints = tuple(joint.model_copy(update={"friction": FRICTION}) for joint in robot.joints)
    model = RobotModel.from_description(robot.model_copy(update={"joints": joints}))
    period_s = float(np.median(np.diff(time_s)))
    signals = smooth_nonperiodic(
        _recording(robot, samples, time_s, coupling), min(BAND_HZ, 0.4 / period_s)
    )
    rows = np.arange(0, len(signals), max(1, math.ceil(len(signals) / MOST_ROWS)))
    velocity = signals.velocity[rows]
    columns = regressor(model, signals.position[rows], velocity, signals.acceleration[rows])
    torque = signals.torque_nm[rows]
    size = np.maximum(np.sqrt(np.mean(torque**2, axis=0)), 1e-9)
    columns, torque = columns / size[:, np.newaxis], torque / size
    guard = 1 + 2 * math.ceil(GUARD_S / signals.sample_period_s)
    # Use the lowest speed around each row, so that rows near reversals are excluded.
    slowest = minimum_filter1d(np.abs(signals.velocity), guard, axis=0)
    use = slowest[rows] > STANDSTILL_SPEED
    halves = np.array_split(np.arange(len(rows)), 2)
    errors = []
    for fitted, judged in (halves, halves[::-1]):
        own = use[fitted]
        matrix = columns[fitted][own]
        scale = np.maximum(np.sqrt(np.mean(matrix**2, axis=0)), 1e-12)
        found = np.linalg.lstsq(matrix / scale, torque[fitted][own], rcond=CONDITION)[0] / scale
        left = np.where(use[judged], torque[judged] - columns[judged] @ found, np.nan)
        errors += [_column_mean_squares(part) for part in np.array_split(left, PARTS)]
    return np.array(errors)


def _has_finite_value(values: FloatArray) -> bool:
    return bool(np.isfinite(values).any())


def _column_mean_squares(values: FloatArray) -> FloatArray:
    """Return the mean square of each column; NaN for a column without a finite value."""
    count = np.isfinite(values).sum(axis=0)
    return np.asarray(
        np.where(count > 0, np.nansum(values**2, axis=0), np.nan) / np.maximum(count, 1)
    )


def _recording(
    robot: RobotDescription, samples: Samples, time_s: FloatArray, coupling: FloatArray | None
) -> Recording:
    rows = len(time_s)
    return Recording(
        joint_names=robot.joint_names,
        time_s=time_s,
        position=samples.position if coupling is None else samples.position @ coupling.T,
        torque_nm=samples.torque,
        valid=np.ones(rows, dtype=np.bool_),
        phase=np.full(rows, Phase.MAIN, dtype=np.uint8),
        sample_index=np.full(rows, -1, dtype=np.int64),
        source="import",
    )
