"""The report's curves, and the validation section that they belong to."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from acquisition.processing.periods import PeriodAverage
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.estimation.estimate import Estimate
from identification.validation.period_comparison import compare_period
from identification.validation.torque_prediction import Validation
from rid_daq.report.sections import rounded, thinned, units


def validation_section(
    validation: Validation,
    robot: RobotDescription,
    sentence: str,
    floor_nm: FloatArray | None = None,
) -> dict[str, Any]:
    """Return the torque errors of every axis and what they are held to.

    Parameters
    ----------
    validation
        The comparison.
    robot
        The robot, for units.
    sentence
        Which run was predicted.
    floor_nm
        RMS error of the true parameters, shape (n,), where the robot is simulated.
    """
    axes: list[dict[str, Any]] = []
    for i, joint in enumerate(robot.joints):
        moving = validation.moving[:, i]
        measured = validation.measured_nm[moving, i]
        error = _known(validation.rms_nm[i])
        floor = None if floor_nm is None else _known(floor_nm[i])
        limits = validation.limits_percent
        axes.append(
            {
                "joint": joint.name,
                "unit": units(joint)[1],
                "rms_torque": float(np.sqrt(np.mean(measured**2))) if len(measured) else None,
                "rms_error": error,
                "relative_error_percent": _known(validation.relative_percent[i]),
                "all_samples_percent": _known(validation.all_samples_percent[i]),
                "noise": None if validation.noise_nm is None else float(validation.noise_nm[i]),
                "floor": floor,
                "error_over_floor": None if error is None or not floor else error / floor,
                "limit_percent": None if limits is None else limits[i],
                "passed": validation.verdicts[i],
                "samples": int(np.count_nonzero(moving)),
            }
        )
    shares = ", ".join(f"{100.0 * share:.0f}" for share in validation.moving_fraction)
    return {
        "sentence": f"{sentence} Signals below {validation.cutoff_hz:g} Hz (no phase shift); errors"
        f" count samples at {validation.standstill_rad_s:g} rad/s or faster ({shares} % of each"
        " axis): below, friction is stiction.",
        "cutoff_hz": validation.cutoff_hz,
        "standstill_rad_s": validation.standstill_rad_s,
        "has_floor": floor_nm is not None,
        "has_limits": validation.limits_percent is not None,
        "axes": axes,
    }


def torque_curves(validation: Validation, robot: RobotDescription) -> dict[str, Any]:
    """Return measured and predicted torque over time, thinned for drawing; and what counts."""
    rows = thinned(len(validation.time_s))
    axes: list[dict[str, Any]] = []
    for i, joint in enumerate(robot.joints):
        error, share = _known(validation.rms_nm[i]), _known(validation.relative_percent[i])
        unit = units(joint)[1]
        caption = "stands still"
        if error is not None and share is not None:
            caption = f"rms error {error:.3g} {unit}, {share:.3g} % of the torque"
        axes.append(
            {
                "joint": joint.name,
                "unit": unit,
                "caption": caption,
                "measured": rounded(validation.measured_nm[rows, i]),
                "predicted": rounded(validation.predicted_nm[rows, i]),
                "counted": [int(moving) for moving in validation.moving[rows, i]],
            }
        )
    return {
        "sentence": "Grey: standstill, where the error does not count.",
        "time_s": rounded(validation.time_s[rows] - validation.time_s[0], 7),
        "axes": axes,
    }


def period_curves(estimate: Estimate, average: PeriodAverage) -> dict[str, Any]:
    """Return a mean period's torques over time, and by frequency against the noise floor.

    Parameters
    ----------
    estimate
        The estimate, of a periodic recording.
    average
        The averaged periods behind it.

    Returns
    -------
    dict
        `torque` as `torque_curves` has it, and `spectrum`.
    """
    comparison = compare_period(estimate, average)
    rows = thinned(len(comparison.time_s))
    torque: list[dict[str, Any]] = []
    spectrum: list[dict[str, Any]] = []
    for i, joint in enumerate(estimate.robot.joints):
        residual = float(estimate.residual_nm[i])
        unit = units(joint)[1]
        torque.append(
            {
                "joint": joint.name,
                "unit": unit,
                "caption": f"rms residual of the fit {residual:.3g} {unit}",
                "measured": rounded(comparison.measured_nm[rows, i]),
                "predicted": rounded(comparison.predicted_nm[rows, i]),
                "counted": [1] * len(comparison.time_s[rows]),
            }
        )
        spectrum.append(
            {
                "joint": joint.name,
                "measured_nm": rounded(comparison.measured_spectrum_nm[1:, i]),
                "residual_nm": rounded(comparison.residual_spectrum_nm[1:, i]),
                "noise_nm": rounded(comparison.noise_spectrum_nm[1:, i]),
            }
        )
    return {
        "torque": {
            "sentence": f"The mean of {average.periods_kept} periods; the model was fitted to it.",
            "time_s": rounded(comparison.time_s[rows], 7),
            "axes": torque,
        },
        "spectrum": {
            "sentence": "Per harmonic of the mean period: torque, what the model leaves of it"
            " (standstill included), and what the noise between periods leaves there"
            f" ({average.periods_kept} averaged). Anti-alias filter divided out.",
            "frequency_hz": rounded(comparison.frequency_hz[1:], 7),
            "axes": spectrum,
        },
    }


def _known(value: float) -> float | None:
    return None if math.isnan(value) else float(value)
