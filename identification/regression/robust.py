"""Huber's weights: rows with large residuals are held down (Huber 1964)."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray

HUBER_LIMIT: Final = 1.345
"""In standard deviations; 95 % as efficient as least squares where the noise is Gaussian."""

_NORMAL_MAD: Final = 0.6744897501960817


def huber_weights(residual: FloatArray) -> FloatArray:
    """Return weights min(1, 1.345 s / |r|), with s the residuals' robust standard deviation.

    Parameters
    ----------
    residual : ndarray, shape (rows,)
        Residuals of one kind; s is their median size over 0.6745.
    """
    size = np.abs(residual)
    if size.size == 0:
        return size
    limit = HUBER_LIMIT * float(np.median(size)) / _NORMAL_MAD
    return np.asarray(np.minimum(1.0, limit / np.maximum(size, max(limit, 1e-300))))
