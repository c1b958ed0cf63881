"""`InstrumentUnknowns`: geometry, frames and delays that affect the signals of the instruments.

They are eliminated from the residuals by projection, as friction is, and renewed between the rounds
of the fit, because the residuals depend on them linearly only for small changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from config.arrays import FloatArray
from identification.elasticity.elastic_runs import ExcitationBins
from identification.elasticity.link_side import (
    DELAY_SIGMA_S,
    GEOMETRY_SIGMA,
    LinkSideBins,
    TrackedBins,
    geometry_of,
)
from identification.kinematics.parameters import KinematicParameter

_DEPENDENT: Final = 1e-7


@dataclass(frozen=True, eq=False)
class InstrumentUnknowns:
    """Unknowns of all instruments, in this order: geometry, then frame and delay of each one.

    Attributes:
        geometry: Geometric parameters that all trackers share.
    """

    geometry: tuple[KinematicParameter, ...]

    @classmethod
    def of(cls, excitations: Sequence[ExcitationBins]) -> InstrumentUnknowns:
        """Return the unknowns of the instruments of some runs."""
        pairs = [
            (each, run.motors)
            for run in excitations
            for each in run.link_side
            if isinstance(each, TrackedBins)
        ]
        if not pairs:
            return cls(())
        tracked, motions = zip(*pairs, strict=True)
        return cls(geometry_of(tracked, motions))

    def basis(self, excitations: Sequence[ExcitationBins], sigma: FloatArray) -> FloatArray:
        """Return an orthonormal basis of the weighted residuals that the unknowns can cause.

        Args:
            sigma: Shape (rows,). Standard deviation of each residual.
        """
        columns = self._columns(excitations) / sigma[:, np.newaxis]
        size = np.linalg.norm(columns, axis=0)
        columns = columns[:, size > 0.0] / size[size > 0.0]
        basis, values, _ = np.linalg.svd(columns, full_matrices=False)
        return np.asarray(basis[:, values > _DEPENDENT * values[:1]])

    def renewed(
        self, excitations: Sequence[ExcitationBins], residual: FloatArray, sigma: FloatArray
    ) -> tuple[ExcitationBins, ...]:
        """Return the runs with the unknowns that explain a residual best.

        Args:
            residual: Shape (rows,). Measured minus predicted, real and imaginary parts.
            sigma: Shape (rows,). Standard deviation of each residual.
        """
        columns = self._columns(excitations) / sigma[:, np.newaxis]
        prior = np.diag(1.0 / self._prior(excitations))
        step: FloatArray = np.linalg.lstsq(
            np.concatenate([columns, prior]),
            np.concatenate([residual / sigma, np.zeros(len(prior))]),
            rcond=None,
        )[0]
        shared, first = step[: len(self.geometry)], len(self.geometry)
        found = []
        for run in excitations:
            moved: list[LinkSideBins] = []
            for each in run.link_side:
                own = step[first : first + len(each.frame) + 1]
                moved.append(each.moved(self.geometry, np.concatenate([shared, own])))
                first += len(own)
            found.append(replace(run, link_side=tuple(moved)))
        return tuple(found)

    def _columns(self, excitations: Sequence[ExcitationBins]) -> FloatArray:
        """Return the derivatives of the predictions, (rows, unknowns)."""
        width, first = len(self._prior(excitations)), len(self.geometry)
        blocks = []
        for run in excitations:
            for each in run.link_side:
                slopes = each.slopes(run.motors, run.period_s, self.geometry)
                rows = np.concatenate([slopes.real, slopes.imag]).transpose(1, 0, 2)
                rows = rows.reshape(-1, slopes.shape[2])
                shared, own = len(self.geometry), len(each.frame) + 1
                block = np.zeros((len(rows), width))
                block[:, :shared] = rows[:, :shared]
                block[:, first : first + own] = rows[:, shared:]
                blocks.append(block)
                first += own
        return np.concatenate(blocks)

    def _prior(self, excitations: Sequence[ExcitationBins]) -> FloatArray:
        """Return the standard deviation of the prior of each unknown."""
        sigmas = [GEOMETRY_SIGMA] * len(self.geometry)
        for run in excitations:
            for each in run.link_side:
                sigmas += [*[GEOMETRY_SIGMA] * len(each.frame), DELAY_SIGMA_S]
        return np.array(sigmas)
