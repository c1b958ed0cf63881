"""Criteria of an excitation trajectory: functions of the information about the base parameters.

The information is the inverse of the covariance that an estimate would have, for one sample with
unit noise. Each criterion provides its objective, which is minimised, and a smooth approximation
with its exact gradient for the search.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from config.arrays import FloatArray

NORM_POWER = 12
INFORMATION_SHARE = 0.3
_SMALLEST_EIGENVALUE = 1e-14


class Criterion(Protocol):
    """Quantity that a search minimises."""

    @abstractmethod
    def objective(self, information: FloatArray) -> float:
        """Return the criterion's value for an information matrix (b, b)."""

    @abstractmethod
    def smooth(self, information: FloatArray) -> tuple[float, FloatArray]:
        """Return a smooth approximation of the criterion, and its gradient (b, b)."""

    @abstractmethod
    def describe(self, objective: float) -> str:
        """Return a value of the criterion in words."""


@dataclass(frozen=True)
class DOptimal:
    """Negative log determinant of the information, per parameter (D-optimality).

    It measures the volume of the confidence ellipsoid. Its optimum does not depend on the
    parameters' units.
    """

    def objective(self, information: FloatArray) -> float:
        """Return the criterion's value for an information matrix (b, b)."""
        return self.smooth(information)[0]

    def smooth(self, information: FloatArray) -> tuple[float, FloatArray]:
        """Return the criterion, and its derivatives with respect to the information (b, b)."""
        log_det, inverse = _log_det(information)
        return -log_det / len(information), -inverse / len(information)

    def describe(self, objective: float) -> str:
        """Return a value of the criterion in words."""
        return f"log determinant {-objective:.4g} (per parameter)"


@dataclass(frozen=True, eq=False)
class Condition:
    """Condition number of the weighted base regressor (2.25, 2.26).

    By default each column is scaled to length one, so that units have no effect. This condition
    number does not depend on the size of a motion. Therefore the search also uses a fraction of the
    log determinant. If `parameter_size` (b,) is given, each column is multiplied by the size of its
    parameter instead.
    """

    parameter_size: FloatArray | None = None

    def objective(self, information: FloatArray) -> float:
        """Return the condition number for an information matrix (b, b)."""
        eigenvalues, _ = _eigen(information, self._size(information))
        return math.sqrt(float(eigenvalues[-1] / eigenvalues[0]))

    def smooth(self, information: FloatArray) -> tuple[float, FloatArray]:
        """Return the logarithm of a smooth condition number, and its derivatives (b, b).

        Norms of all eigenvalues replace the largest and the smallest eigenvalue.
        """
        size = self._size(information)
        eigenvalues, vectors = _eigen(information, size)
        high = (eigenvalues / eigenvalues[-1]) ** NORM_POWER
        low = (eigenvalues[0] / eigenvalues) ** NORM_POWER
        objective = 0.5 * math.log(eigenvalues[-1] / eigenvalues[0])
        objective += 0.5 / NORM_POWER * (math.log(high.sum()) + math.log(low.sum()))
        slope = 0.5 * (high / high.sum() - low / low.sum()) / eigenvalues
        inner = (vectors * slope) @ vectors.T
        gradient = inner / np.outer(size, size)
        if self.parameter_size is None:
            scaled = information / np.outer(size, size)
            gradient -= np.diag(np.sum(inner * scaled, axis=1) / size**2)
            log_det, inverse = _log_det(information)
            objective -= INFORMATION_SHARE * log_det / len(size)
            gradient -= INFORMATION_SHARE * inverse / len(size)
        return objective, gradient

    def describe(self, objective: float) -> str:
        """Return a value of the criterion in words."""
        return f"condition number {objective:.4g}"

    def _size(self, information: FloatArray) -> FloatArray:
        if self.parameter_size is None:
            return column_sizes(information)
        return 1.0 / self.parameter_size


@dataclass(frozen=True, eq=False)
class Goals:
    """Mean log standard deviation of chosen combinations, the rows of `wanted` (k, b).

    A row of the unit matrix stands for one parameter, a row of a regressor for a predicted torque.
    """

    wanted: FloatArray

    def objective(self, information: FloatArray) -> float:
        """Return the criterion's value for an information matrix (b, b)."""
        return self.smooth(information)[0]

    def smooth(self, information: FloatArray) -> tuple[float, FloatArray]:
        """Return the criterion, and its derivatives with respect to the information (b, b)."""
        _, inverse = _log_det(information)
        spread = self.wanted @ inverse
        variance = np.einsum("kb,kb->k", spread, self.wanted)
        objective = 0.5 * float(np.mean(np.log(variance)))
        gradient = -0.5 * (spread / variance[:, np.newaxis]).T @ spread / len(variance)
        return objective, gradient

    def describe(self, objective: float) -> str:
        """Return a value of the criterion in words."""
        return f"mean log deviation {objective:.4g}"


def column_sizes(information: FloatArray) -> FloatArray:
    """Return the lengths of the regressor's columns from its information, (b,), all positive."""
    size = np.sqrt(np.maximum(np.diagonal(information), 0.0))
    return np.asarray(np.maximum(size, 1e-9 * max(float(size.max()), 1e-300)))


def _log_det(information: FloatArray) -> tuple[float, FloatArray]:
    """Return the log determinant and the inverse, computed from the scaled information."""
    size = column_sizes(information)
    eigenvalues, vectors = _eigen(information, size)
    inverse = (vectors / eigenvalues) @ vectors.T / np.outer(size, size)
    return float(np.sum(np.log(eigenvalues)) + 2.0 * np.sum(np.log(size))), inverse


def _eigen(information: FloatArray, size: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return eigenvalues, ascending and positive, and eigenvectors of the scaled information."""
    eigenvalues, vectors = np.linalg.eigh(information / np.outer(size, size))
    return np.maximum(eigenvalues, _SMALLEST_EIGENVALUE * eigenvalues[-1]), vectors
