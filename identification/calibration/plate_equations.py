"""`PlateEquations`: the base wrench of some runs, condensed for fast trials of wrench matrices.

The measured wrench is a matrix of shape (6, c) times the plate's readings: eight channels, or the
six components of a plate that computes the wrench itself.
Least squares needs only sums of products of regressor columns and readings; they are computed once.
Therefore the time to try another matrix does not depend on the length of the runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.processing.periods import PeriodAverage
from acquisition.signals.bins import filter_response, to_bins
from config.arrays import FloatArray
from identification.equations.base_wrench import real_rows_of_bins, without_delay
from identification.equations.bins import BinEquations
from identification.equations.plate_fit import SMALL_COMPONENT

RIDGE: Final = 1e-10
SMALLEST_SHARE: Final = 0.01


@dataclass(frozen=True, eq=False)
class PlateEquations:
    """Sums of products of regressor columns and channel readings, without constant parts.

    Attributes:
        columns: Shape (6, b, b). Phi^T Phi of the regressor Phi of each component of the wrench.
        crossed: Shape (6, b, c). Phi^T y of the channels' readings y.
        channels: Shape (c, c). y^T y [N^2].
    """

    columns: FloatArray
    crossed: FloatArray
    channels: FloatArray

    @classmethod
    def of(
        cls,
        averages: Sequence[PeriodAverage],
        equations: Sequence[BinEquations],
        delays_s: Sequence[float],
    ) -> PlateEquations | None:
        """Condense the runs' equations; None if a run lacks a channel or their channels differ.

        Args:
            averages: The runs' mean periods.
            equations: Equations of the mean periods, of the external or the combined model.
            delays_s: Delay of the plate's signals in each run [s].
        """
        columns, channels = [], []
        for each, average, delay_s in zip(equations, averages, delays_s, strict=True):
            own, wrench = average.reaction, each.reaction
            if own is None or wrench is None or len(wrench.components) < 6:
                return None
            response = np.ones(wrench.harmonics + 1, dtype=complex)
            if own.low_pass is not None:
                frequencies = np.arange(wrench.harmonics + 1) / wrench.period_s
                response = filter_response(own.low_pass, frequencies)
            bins = to_bins(own.channels_n, wrench.harmonics) / response[:, np.newaxis]
            rows = without_delay(real_rows_of_bins(bins).T, wrench.period_s, delay_s)
            channels.append(rows[:, 1:])
            columns.append(wrench.matrix[:, 1:])
        if len({each.shape[0] for each in channels}) > 1:
            return None
        phi, y = np.concatenate(columns, axis=1), np.concatenate(channels, axis=1)
        return cls(phi.swapaxes(1, 2) @ phi, phi.swapaxes(1, 2) @ y.T, y @ y.T)

    def shares(self, matrix: FloatArray) -> FloatArray:
        """Return the residual of each component relative to its size, for a wrench matrix (6, c).

        Values below `SMALLEST_SHARE` are replaced by it.
        """
        power, size = self._component_sizes(matrix)
        crossed = np.einsum("wbc,wc->wb", self.crossed, matrix)
        weight = 1.0 / size**2
        values = _solve(np.tensordot(weight, self.columns, axes=1), weight @ crossed)
        left = power - 2.0 * crossed @ values + self.columns @ values @ values
        return np.asarray(np.maximum(np.sqrt(np.maximum(left, 0.0)) / size, SMALLEST_SHARE))

    def best_parameters(self, matrix: FloatArray, slopes: FloatArray) -> FloatArray:
        """Return theta (k,) for which the wrench matrix `matrix` + theta `slopes` fits best.

        `slopes` (k, 6, c) is the derivative of the wrench matrix with respect to theta.
        """
        _, size = self._component_sizes(matrix)
        weight, k = 1.0 / size**2, len(slopes)
        mixed = -np.einsum("w,wbc,kwc->bk", weight, self.crossed, slopes)
        own = np.einsum("w,kwc,cd,lwd->kl", weight, slopes, self.channels, slopes)
        gram = np.block([[np.tensordot(weight, self.columns, axes=1), mixed], [mixed.T, own]])
        of_columns = np.einsum("w,wbc,wc->b", weight, self.crossed, matrix)
        of_slopes = -np.einsum("w,kwc,cd,wd->k", weight, slopes, self.channels, matrix)
        return _solve(gram, np.concatenate([of_columns, of_slopes]))[-k:]

    def weight(self, matrix: FloatArray, drawn: FloatArray) -> float:
        """Return the measured wrench over that of the drawn parameters (b,), by projection."""
        _, size = self._component_sizes(matrix)
        power = self.columns @ drawn @ drawn
        measured = np.einsum("wbc,wc,b->w", self.crossed, matrix, drawn)
        return float(np.sum(measured / size**2) / max(float(np.sum(power / size**2)), 1e-300))

    def _component_sizes(self, matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return each component's sum of squares, and its root, (6,) each.

        The root of a small component is raised to a fraction of the largest force or moment.
        """
        power = np.einsum("wc,cd,wd->w", matrix, self.channels, matrix)
        size = np.sqrt(np.maximum(power, 0.0))
        for part in (slice(0, 3), slice(3, 6)):
            size[part] = np.maximum(size[part], SMALL_COMPONENT * size[part].max())
        return power, np.maximum(size, 1e-12)


def _solve(gram: FloatArray, rhs: FloatArray) -> FloatArray:
    scale = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
    scaled = gram / scale / scale[:, np.newaxis] + RIDGE * np.eye(len(scale))
    return np.asarray(np.linalg.solve(scaled, rhs / scale) / scale)
