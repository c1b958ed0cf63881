"""`PriorRows`: prior knowledge as equations of the base parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space

from config.arrays import FloatArray
from config.errors import EstimationError
from identification.estimation.options import Prior
from identification.model.base_parameters import BaseParameters
from identification.regression.least_squares import Triangle

SMALLEST_SIGMA_SHARE = 1e-9


@dataclass(frozen=True, eq=False)
class PriorRows:
    """Equations matrix beta = rhs with unit noise, from Gaussian knowledge of standard parameters.

    Attributes:
        matrix: Shape (rows, b). Rows of the Bayesian prior; they are appended to the measurement's
            equations.
        rhs: Shape (rows,). Right-hand side.
    """

    matrix: FloatArray
    rhs: FloatArray

    @classmethod
    def none(cls, base: BaseParameters) -> PriorRows:
        """Return a prior without knowledge: no equations."""
        return cls(np.zeros((0, len(base))), np.zeros(0))

    @classmethod
    def of(cls, base: BaseParameters, values: FloatArray, sigmas: FloatArray) -> PriorRows:
        """Convert values and standard deviations of standard parameters to equations.

        With beta = K theta, a combination of beta is known if it contains no parameter of infinite
        sigma. The covariance of these combinations follows from K.

        Args:
            base: The base parameters.
            values, sigmas: Shape (p,). Independent standard parameters; sigma is infinite if
                nothing is known, and 0 to fix a value.

        Raises:
            EstimationError: The shapes do not fit, or a sigma is negative or not a number.
        """
        shape = (len(base.standard_names),)
        if values.shape != shape or sigmas.shape != shape or not np.all(sigmas >= 0.0):
            raise EstimationError(
                f"a prior needs {shape[0]} values and {shape[0]} sigmas, and no sigma may be"
                " negative",
                code="RID-API-ARGUMENT",
            )
        known = np.isfinite(sigmas)
        if not known.any():
            return cls.none(base)
        unknown = base.combination[:, ~known]
        free = null_space(unknown.T) if unknown.any() else np.eye(len(base))
        gain = free.T @ base.combination[:, known]
        largest = float(np.max(np.abs(values[known]), initial=float(sigmas[known].max())))
        sigma = np.maximum(sigmas[known], SMALLEST_SIGMA_SHARE * max(largest, 1e-300))
        left, size, _ = np.linalg.svd(gain * sigma, full_matrices=False)
        keep = size > 1e-12 * size.max(initial=0.0)
        whitening = (left[:, keep] / size[keep]).T
        return cls(whitening @ free.T, whitening @ (gain @ values[known]))

    def triangle(self, width: int) -> Triangle:
        """Return the equations as a triangle of `width` parameters, base parameters first."""
        columns = np.arange(self.matrix.shape[1])
        return Triangle.empty(width, columns).add(self.matrix, self.rhs)


def prior_rows(base: BaseParameters, prior: Prior | None) -> PriorRows:
    """Return prior knowledge as equations; no equations if `prior` is None."""
    return PriorRows.none(base) if prior is None else PriorRows.of(base, *prior)
