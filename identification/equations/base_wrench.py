"""`BaseWrenchEquations`: the base wrench of one mean period as equations on its DFT bins.

These equations complement those of the joints in `BinEquations`. Every channel of the plate
contributes to several of the six components of the wrench. The noise of the components is therefore
correlated; it is measured as one covariance matrix per bin. If a channel is left out, some
combinations of the six components do not depend on it, and only these are used.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import null_space

from acquisition.processing.reaction_average import ReactionAverage
from acquisition.signals.bins import Bins, filter_response, to_bins
from config.arrays import FloatArray
from config.errors import EstimationError

NEIGHBOURS = 4
OFFSET_SIGMA = 1e4
"""Assumed standard deviation of a plate's unknown offset, above any robot's weight [N, N m]."""


@dataclass(frozen=True, eq=False)
class BaseWrenchEquations:
    """Equations rhs = matrix beta + noise for the r measured combinations of the base wrench.

    Attributes:
        period_s: The period [s].
        matrix: Shape (r, 2 H + 1, any). Columns as in `BinEquations`.
        rhs: Shape (r, 2 H + 1). Measured values, with the plate's low-pass divided out [N, N m].
        covariance: Shape (H + 1, r, r). Noise covariance of the rows of each bin.
        components: Shape (r, 6). Each row contains the coefficients of Fx, Fy, Fz, Mx, My, Mz; the
            unit matrix if every channel is used.
    """

    period_s: float
    matrix: FloatArray
    rhs: FloatArray
    covariance: FloatArray
    components: FloatArray

    @property
    def harmonics(self) -> int:
        """Number of the highest bin, H."""
        return len(self.covariance) - 1

    def compensate_delay(self, delay_s: float) -> BaseWrenchEquations:
        """Return the equations with a delay `delay_s` of the plate's signals compensated."""
        return replace(self, rhs=without_delay(self.rhs, self.period_s, delay_s))

    def with_motion_noise(
        self, position_sigma: FloatArray, inertia_squares: FloatArray
    ) -> BaseWrenchEquations:
        """Return the equations with the wrench due to position noise added to the noise covariance.

        Args:
            position_sigma: Shape (n, H + 1). Standard deviation of the mean position's bins [rad or
                m].
            inertia_squares: Shape (n, 6, 6). Mean of g g^T, in which g is the base wrench per unit
                acceleration of a joint.
        """
        squares = self.components @ inertia_squares @ self.components.T
        noise = np.einsum("jk,jrs->krs", (position_sigma * self._omega**2) ** 2, squares)
        return replace(self, covariance=self.covariance + noise)

    def delay_column(self, predicted: FloatArray) -> FloatArray:
        """Return the derivative of rows (r, 2 H + 1) with respect to the plate's delay [per s]."""
        return rows_per_delay(predicted, self.period_s)

    @property
    def _omega(self) -> FloatArray:
        return _omega(self.harmonics, self.period_s)


def base_wrench_equations(
    reaction: ReactionAverage, periods: int, sample_period_s: float, matrix: FloatArray
) -> BaseWrenchEquations:
    """Set up the equations of a plate's mean period.

    Args:
        reaction: The mean period of the plate's channels.
        periods: Number of periods averaged.
        sample_period_s: Time between samples of the mean period [s].
        matrix: Shape (6, 2 H + 1, any). Columns of all six components.

    Raises:
        EstimationError: The remaining channels determine no component of the wrench.
    """
    harmonics = matrix.shape[1] // 2
    period_s = len(reaction.channels_n) * sample_period_s
    components = np.eye(6)
    if not reaction.used.all():
        components = null_space(reaction.base_wrench_matrix[:, ~reaction.used].T).T
    if len(components) == 0:
        raise EstimationError(
            f"without channels {', '.join(reaction.left_out)} the force plate determines no"
            " component of the base wrench: estimate without the force plate",
            code="RID-PLATE-CHANNEL",
        )
    from_channels = components @ reaction.base_wrench_matrix
    response = np.ones(harmonics + 1, dtype=complex)
    if reaction.low_pass is not None:
        response = filter_response(reaction.low_pass, np.arange(harmonics + 1) / period_s)
    bins = to_bins(reaction.channels_n, harmonics) @ from_channels.T / response[:, np.newaxis]
    covariance = from_channels @ reaction.bin_covariance @ from_channels.T
    covariance = _smooth_covariance(covariance)[: harmonics + 1] / periods
    covariance /= np.abs(response[:, np.newaxis, np.newaxis]) ** 2
    covariance[0] += OFFSET_SIGMA**2 * np.eye(len(components))
    return BaseWrenchEquations(
        period_s=period_s,
        matrix=np.tensordot(components, matrix, axes=1),
        rhs=real_rows_of_bins(bins).T,
        covariance=covariance,
        components=components,
    )


def real_rows_of_bins(bins: Bins) -> FloatArray:
    """Return complex bins (H + 1, outputs) as real rows (2 H + 1, outputs)."""
    root = math.sqrt(2.0)
    return np.concatenate([bins.real[:1], root * bins.real[1:], root * bins.imag[1:]])


def repeat_for_real_and_imaginary(per_bin: FloatArray) -> FloatArray:
    """Repeat values of bins 0 to H (first axis) for the real and the imaginary rows."""
    return np.concatenate([per_bin, per_bin[1:]])


def without_delay(rows: FloatArray, period_s: float, delay_s: float | FloatArray) -> FloatArray:
    """Return rows (outputs, 2 H + 1) of delayed signals with the delay removed.

    Args:
        rows: Shape (outputs, 2 H + 1). Rows of one period.
        period_s: The period [s].
        delay_s: Float or ndarray, shape (outputs, 1). Delay of the signals [s].
    """
    turn = np.exp(1j * _omega(rows.shape[1] // 2, period_s) * delay_s)
    return np.asarray(real_rows_of_bins((_bins(rows) * turn).T).T)


def rows_per_delay(rows: FloatArray, period_s: float) -> FloatArray:
    """Return the derivative of a period's rows (outputs, 2 H + 1) with respect to the delay."""
    rate = -1j * _omega(rows.shape[1] // 2, period_s)
    return np.asarray(real_rows_of_bins((rate * _bins(rows)).T).T)


def average_neighbouring_bins(per_bin: FloatArray) -> FloatArray:
    """Return values of bins (first axis), each averaged with its neighbours."""
    edges = ((NEIGHBOURS, NEIGHBOURS), *((0, 0) for _ in per_bin.shape[1:]))
    padded = np.pad(per_bin, edges, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOURS + 1, axis=0)
    return np.asarray(windows.mean(axis=-1))


def _omega(harmonics: int, period_s: float) -> FloatArray:
    return 2.0 * math.pi / period_s * np.arange(harmonics + 1, dtype=np.float64)


def _bins(rows: FloatArray) -> Bins:
    """Return the complex bins (outputs, H + 1) of rows (outputs, 2 H + 1)."""
    harmonics = rows.shape[1] // 2
    bins = rows[:, : harmonics + 1].astype(np.complex128)
    bins[:, 1:] += 1j * rows[:, harmonics + 1 :]
    bins[:, 1:] /= math.sqrt(2.0)
    return np.asarray(bins)


def _smooth_covariance(covariance: FloatArray) -> FloatArray:
    """Return each bin's covariance averaged with its neighbours; no variance is reduced.

    A single bin's covariance comes from few periods and scatters. If a bin's own variance is larger
    than the average, the bin keeps its own, as for the torques.
    """
    mean = average_neighbouring_bins(covariance)
    own, common = (np.diagonal(c, axis1=1, axis2=2) for c in (covariance, mean))
    growth = np.sqrt(np.maximum(own / np.maximum(common, 1e-300), 1.0))
    return np.asarray(mean * growth[:, :, np.newaxis] * growth[:, np.newaxis, :])
