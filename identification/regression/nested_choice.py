"""Rules by which `--choose` keeps a term of a model, the same for every kind of term.

A term is kept if its value is distinct from zero and if the error on data left out of the fit
falls by more than its standard error. Errors are compared block by block as logarithms, so that a
few blocks with large errors do not decide alone. Among models that are not distinctly worse than
the best one the simplest is taken (one-standard-error rule: Breiman and others 1984).
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
"""Distance from zero, in standard deviations, of a value that is kept."""
LEAST_GAIN: Final = 0.003
"""Least gain of held-out error for each value that is added: 0.3 %."""
FEWEST_BLOCKS: Final = 4


def deviations(changes: FloatArray) -> FloatArray:
    """Return standard deviations from a jackknife over blocks, shape (values,).

    They are widened so that `DISTINCT_SIGMAS` of them have the level of a normal distribution
    although there are few blocks (Student's t).

    Args:
        changes: Shape (blocks, values). How each value changes without a block.
    """
    count = len(changes)
    widened = stdtrit(max(count - 1, 1), ndtr(DISTINCT_SIGMAS)) / DISTINCT_SIGMAS
    return np.asarray(widened * np.sqrt((count - 1) / count * np.sum(changes**2, axis=0)))


@dataclass(frozen=True)
class Gain:
    """How much smaller the held-out RMS error of one model is, as a logarithm.

    Attributes:
        mean: Mean over the blocks; 0.01 is 1 %.
        standard_error: Standard error of the mean.
    """

    mean: float
    standard_error: float

    @classmethod
    def between(cls, simpler: FloatArray, richer: FloatArray) -> Gain:
        """Return the gain of the richer model.

        Args:
            simpler, richer: Mean squared errors of the blocks; NaN in blocks that do not count.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = 0.5 * np.log(simpler / richer)
        known = ratio[np.isfinite(ratio)]
        if len(known) < FEWEST_BLOCKS:
            return cls(0.0, math.inf)
        return cls(float(known.mean()), float(np.std(known, ddof=1)) / math.sqrt(len(known)))

    def exceeds(self, sigmas: float = 1.0, least: float = LEAST_GAIN) -> bool:
        """Return True if the gain is larger than some standard errors and than a least gain."""
        return self.mean > max(sigmas * self.standard_error, least)


def simplest(errors: Sequence[FloatArray], sigmas: float = 1.0, least: float = 0.0) -> int:
    """Return the first of models, the simplest first, that is not distinctly worse than the best.

    Args:
        errors: Mean squared errors of each model's blocks.
        sigmas, least: Standard errors, and gain, by which the best must be better.
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
    """Return the joints whose held-out error falls enough, shape (n,).

    Args:
        simpler, richer: Shape (blocks, n). Mean squared errors; NaN in blocks that do not count.
        sigmas, least: As for `Gain.exceeds`.
    """
    return np.array(
        [
            Gain.between(a, b).exceeds(sigmas, least)
            for a, b in zip(simpler.T, richer.T, strict=True)
        ]
    )
