"""The report's curves, and the validation section that they belong to."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from acquisition.periods import PeriodAverage
from config.robot import RobotDescription
from identification.bin_equations import bin_equations
from identification.estimators import Estimate
from identification.validation import Validation
from rid_daq.sections import rounded, thinned, units

FloatArray = npt.NDArray[np.float64]


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
    """Return measured and predicted torque over time, thinned for drawing."""
    rows = thinned(len(validation.time_s))
    time_s = validation.time_s[rows] - validation.time_s[0]
    return {
        "time_s": rounded(time_s, 7),
        "axes": [
            {
                "joint": joint.name,
                "unit": units(joint)[1],
                "measured": rounded(validation.measured_nm[rows, i]),
                "predicted": rounded(validation.predicted_nm[rows, i]),
            }
            for i, joint in enumerate(robot.joints)
        ],
    }


def spectrum_curves(estimate: Estimate, average: PeriodAverage) -> dict[str, Any]:
    """Return what a mean period leaves over per harmonic, and the noise floor, as amplitudes.

    Parameters
    ----------
    estimate
        The estimate, of a periodic recording.
    average
        One of the averaged periods behind it.
    """
    equations = bin_equations(
        estimate.model,
        estimate.base,
        average,
        band_hz=estimate.band_hz,
        standstill_rad_s=estimate.standstill_rad_s,
    )
    residual = _amplitude(equations.rhs - equations.matrix @ estimate.values)
    noise = _amplitude(equations.torque_sigma)
    harmonics = np.arange(1, equations.harmonics + 1)
    return {
        "sentence": "Amplitude at every harmonic of what the model leaves of the mean period's"
        " torque, standstill included, and of what the noise between periods leaves there"
        f" ({average.periods_kept} periods averaged, anti-alias filter divided out).",
        "frequency_hz": rounded(harmonics / equations.period_s, 7),
        "axes": [
            {
                "joint": joint.name,
                "residual_nm": rounded(residual[i]),
                "noise_nm": rounded(noise[i]),
            }
            for i, joint in enumerate(estimate.robot.joints)
        ],
    }


def _amplitude(rows: FloatArray) -> FloatArray:
    """Return the amplitudes of harmonics 1 to H from rows of shape (n, 2 H + 1)."""
    harmonics = rows.shape[1] // 2
    real, imaginary = rows[:, 1 : harmonics + 1], rows[:, harmonics + 1 :]
    return np.asarray(np.sqrt(2.0) * np.hypot(real, imaginary))


def _known(value: float) -> float | None:
    return None if math.isnan(value) else float(value)
