"""`fourier_basis`: constant, sines and cosines over a period, with their derivatives."""

from __future__ import annotations

import math

import numpy as np

from config.arrays import FloatArray


def fourier_basis(period_s: float, harmonics: int, points_per_harmonic: int) -> FloatArray:
    """Return the values of a constant 1, of sines and of cosines over one period (2.30).

    A periodic motion of a joint is this basis times its coefficients: offset, sine amplitudes,
    cosine amplitudes.

    Args:
        period_s: The period [s].
        harmonics: The highest harmonic, N.
        points_per_harmonic: Number of points per period of the highest harmonic.

    Returns:
        Shape (3, points_per_harmonic N, 2 N + 1). The basis, its first derivative [1/s] and its
        second derivative [1/s^2]. Columns: the constant, N sines, N cosines.
    """
    points = points_per_harmonic * harmonics
    omega = 2.0 * math.pi / period_s * np.arange(1, harmonics + 1)
    angle = np.outer(np.arange(points) / points * period_s, omega)
    one, sine, cosine = np.ones((points, 1)), np.sin(angle), np.cos(angle)
    rows = [
        np.hstack([one, sine, cosine]),
        np.hstack([0.0 * one, omega * cosine, -omega * sine]),
        np.hstack([0.0 * one, -(omega**2) * sine, -(omega**2) * cosine]),
    ]
    return np.asarray(rows, dtype=float)
