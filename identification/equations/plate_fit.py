"""`PlateFit`: fit of a force plate's signals with an estimate, and their delay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.processing.periods import PeriodAverage
from acquisition.recording.plate_geometry import WRENCH_NAMES
from config.arrays import FloatArray, freeze
from config.errors import EstimationError
from identification.equations.bins import BinEquations
from identification.regression.fit_grade import FitGrade, grade_fit

SMALL_COMPONENT: Final = 0.05


@dataclass(frozen=True, eq=False)
class PlateFit:
    """The part of an estimate that concerns the force plate.

    Attributes:
        residual: Shape (6,). RMS of measured minus predicted base wrench inside the band, without
            its constant part [N, N m].
        noise: Shape (6,). RMS of the residual that the measured noise of channels and positions
            alone would cause [N, N m].
        delay_s, delay_sigma_s: Shape (runs,). Delay of the plate's signals behind the positions in
            each run, in addition to the plate's low-pass and clock; the estimate compensates it.
        left_out: The channels that were left out in each run.
        drift_n_s: Shape (runs, c). Linear drift that was removed from each channel [N/s].
        wrench: Shape (6,). RMS of the measured base wrench inside the band, without its constant
            part [N, N m].
    """

    residual: FloatArray
    noise: FloatArray
    delay_s: FloatArray
    delay_sigma_s: FloatArray
    left_out: tuple[tuple[str, ...], ...]
    drift_n_s: FloatArray
    wrench: FloatArray

    def __post_init__(self) -> None:
        runs = len(self.left_out)
        freeze(self, EstimationError, (6,), "residual", "noise", "wrench", what="plate ")
        freeze(self, EstimationError, (runs,), "delay_s", "delay_sigma_s", what="plate ")
        freeze(self, EstimationError, (runs, None), "drift_n_s", what="plate ")

    @classmethod
    def of(
        cls,
        averages: Sequence[PeriodAverage],
        equations: Sequence[BinEquations],
        inertia_squares: FloatArray,
        values: FloatArray,
        delays_s: FloatArray,
        delay_sigma_s: FloatArray,
    ) -> PlateFit:
        """Compare the plate's wrench of some runs with the predictions of `values` (b or b + s).

        If a channel is left out, combinations that only this channel measures count as zero.
        """
        residual, noise, wrench = np.zeros(6), np.zeros(6), np.zeros(6)
        for each, squares, delay_s in zip(equations, inertia_squares, delays_s, strict=True):
            assert each.reaction is not None
            reaction = each.reaction.with_motion_noise(each.position_sigma, squares)
            reaction = reaction.compensate_delay(float(delay_s))
            rest = reaction.components.T @ (reaction.rhs - reaction.matrix @ values)
            residual += np.sum(rest[:, 1:] ** 2, axis=1)
            wrench += np.sum((reaction.components.T @ reaction.rhs)[:, 1:] ** 2, axis=1)
            power = 2.0 * reaction.covariance[1:].sum(axis=0)
            noise += np.diagonal(reaction.components.T @ power @ reaction.components)
        plates = [average.reaction for average in averages if average.reaction is not None]
        return cls(
            residual=np.sqrt(residual / len(equations)),
            noise=np.sqrt(noise / len(equations)),
            delay_s=delays_s,
            delay_sigma_s=delay_sigma_s,
            left_out=tuple(plate.left_out for plate in plates),
            drift_n_s=np.array([plate.drift_n_s for plate in plates]),
            wrench=np.sqrt(wrench / len(equations)),
        )

    @property
    def grades(self) -> tuple[FitGrade, ...]:
        """Quality of the fit of each component, relative to the component's size.

        A small force or moment is compared with a fraction of the largest one.
        """
        size = self.wrench.copy()
        for part in (slice(0, 3), slice(3, 6)):
            size[part] = np.maximum(size[part], SMALL_COMPONENT * size[part].max())
        of = "component of the base wrench"
        return grade_fit(WRENCH_NAMES, self.residual, size, self.noise, of=of)
