"""`PeriodComparison`: measured and predicted torque of a mean period, in time and frequency."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acquisition.processing.periods import PeriodAverage
from config.arrays import BoolArray, FloatArray
from identification.equations.bins import bin_equations, counted_samples
from identification.equations.whitened import whiten
from identification.estimation.estimate import Estimate


@dataclass(frozen=True, eq=False)
class PeriodComparison:
    """A mean period inside the estimate's band, with the anti-alias filter divided out.

    Attributes:
        time_s: Shape (K,). Time within the period [s].
        measured_nm, predicted_nm: Shape (K, n). Torques [N m or N].
        fitted_nm: Shape (K, n). The fit's torque: the prediction plus the joint's free torque [N m
            or N]. The RMS of measured minus fitted is the estimate's residual.
        counted: Shape (K, n). Samples that the estimate uses for a joint: it moves faster than the
            estimate's standstill speed, or its presliding friction is known.
        frequency_hz: Shape (H + 1,). The bins [Hz].
        measured_spectrum_nm, residual_spectrum_nm: Shape (H + 1, n). RMS of each bin of the
            measured torque, and of measured minus predicted; over all samples, including standstill
            [N m or N].
        noise_spectrum_nm: Shape (H + 1, n). RMS noise of the mean in each bin, from the scatter
            between periods [N m or N].
    """

    time_s: FloatArray
    measured_nm: FloatArray
    predicted_nm: FloatArray
    fitted_nm: FloatArray
    counted: BoolArray
    frequency_hz: FloatArray
    measured_spectrum_nm: FloatArray
    residual_spectrum_nm: FloatArray
    noise_spectrum_nm: FloatArray


def compare_period(estimate: Estimate, average: PeriodAverage) -> PeriodComparison:
    """Predict the torques of a mean period and compare them with the measured ones.

    Raises:
        EstimationError: The joints are not those of the estimate.
    """
    standard = estimate.standard_values if estimate.model.transmission.losses else None
    equations = bin_equations(
        estimate.model,
        estimate.base,
        average,
        band_hz=estimate.band_hz,
        standstill_rad_s=estimate.standstill_rad_s,
        standard=standard,
    )
    columns = slice(0, len(estimate.base))
    predicted = equations.matrix[:, :, columns] @ estimate.values
    n = len(predicted)
    white = whiten(equations, np.zeros((n, n)), uniform=estimate.weighting == "ls")
    left = [(part.rhs - part.matrix[:, columns] @ estimate.values) * part.sigma for part in white]
    samples = average.samples_per_period
    return PeriodComparison(
        time_s=np.arange(samples, dtype=np.float64) * average.sample_period_s,
        measured_nm=equations.to_time(equations.rhs, samples),
        predicted_nm=equations.to_time(predicted, samples),
        fitted_nm=equations.to_time(equations.rhs - np.array(left), samples),
        counted=counted_samples(
            estimate.model, average, estimate.band_hz, estimate.standstill_rad_s
        ),
        frequency_hz=np.arange(equations.harmonics + 1) / equations.period_s,
        measured_spectrum_nm=_per_bin(equations.rhs, equations.harmonics),
        residual_spectrum_nm=_per_bin(equations.rhs - predicted, equations.harmonics),
        noise_spectrum_nm=_per_bin(equations.torque_sigma, equations.harmonics),
    )


def _per_bin(rows: FloatArray, harmonics: int) -> FloatArray:
    """Return the RMS of each bin (H + 1, n) from rows (n, 2 H + 1)."""
    power = np.square(rows[:, : harmonics + 1])
    power[:, 1:] += np.square(rows[:, harmonics + 1 :])
    return np.asarray(np.sqrt(power).T)
