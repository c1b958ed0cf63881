"""Rules by which `--choose` keeps a term of a model, the same for every kind of term.

A term is kept if its value is distinct from zero and if the error on held-out data falls by more
than its standard error. Errors are compared block by block as logarithms, so that a few blocks with
large errors do not dominate. Among models that are not distinctly worse than the best one, the
simplest is chosen (one-standard-error rule: Breiman and others 1984).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import ndtr, stdtrit

from config.arrays import BoolArray, FloatArray

DISTINCT_SIGMAS: Final = 3.5
"""A value is kept if it is at least this many standard deviations from zero."""
LEAST_GAIN: Final = 0.003
"""Smallest useful reduction of the held-out error for each additional value: 0.3 %."""
FEWEST_BLOCKS: Final = 4


def deviations(changes: FloatArray) -> FloatArray:
    """Return standard deviations from a jackknife over blocks, shape (values,).

    For few blocks they are widened (Student's t), so that a value of `DISTINCT_SIGMAS` has the
    significance level of a normal distribution.

    Args:
        changes: Shape (blocks, values). Change of each value when a block is left out.
    """
    count = len(changes)
    widened = stdtrit(max(count - 1, 1), ndtr(DISTINCT_SIGMAS)) / DISTINCT_SIGMAS
    return np.asarray(widened * np.sqrt((count - 1) / count * np.sum(changes**2, axis=0)))


@dataclass(frozen=True)
class Gain:
    """Decrease of the held-out RMS error from one model to another, as a logarithm.

    Attributes:
        mean: Mean over the blocks; 0.01 is 1 %.
        standard_error: Standard error of the mean.
    """

    mean: float
    standard_error: float

    @classmethod
    def between(cls, simpler: FloatArray, richer: FloatArray) -> Gain:
        """Return the gain of the richer model over the simpler one.

        Args:
            simpler, richer: Mean squared errors of the blocks; NaN for blocks that are not used.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = 0.5 * np.log(simpler / richer)
        known = ratio[np.isfinite(ratio)]
        if len(known) < FEWEST_BLOCKS:
            return cls(0.0, math.inf)
        return cls(float(known.mean()), float(np.std(known, ddof=1)) / math.sqrt(len(known)))

    def exceeds(self, sigmas: float = 1.0, least: float = LEAST_GAIN) -> bool:
        """Return True if the gain exceeds `sigmas` standard errors and the gain `least`."""
        return self.mean > max(sigmas * self.standard_error, least)


def simplest_model(errors: Sequence[FloatArray], sigmas: float = 1.0, least: float = 0.0) -> int:
    """Return the index of the first model that is not distinctly worse than the best.

    A model is distinctly worse if the `Gain` of the best model over it exceeds `sigmas` standard
    errors and the value `least`.

    Args:
        errors: Mean squared errors of each model's blocks, the simplest model first.
        sigmas: Number of standard errors.
        least: Smallest gain that counts; 0.01 is 1 % of the RMS error.
    """
    gains = [Gain.between(errors[0], each).mean for each in errors]
    best = errors[int(np.argmax(gains))]
    for number, each in enumerate(errors):
        if not Gain.between(each, best).exceeds(sigmas, least):
            return number
    return int(np.argmax(gains))


def joints_that_gain(
    simpler: FloatArray, richer: FloatArray, sigmas: float = 1.0, least: float = LEAST_GAIN
) -> BoolArray:
    """Return a mask of the joints whose held-out error falls by enough, shape (n,).

    Args:
        simpler, richer: Shape (blocks, n). Mean squared errors; NaN for blocks that are not used.
        sigmas, least: As for `Gain.exceeds`.
    """
    return np.array(
        [
            Gain.between(a, b).exceeds(sigmas, least)
            for a, b in zip(simpler.T, richer.T, strict=True)
        ]
    )
