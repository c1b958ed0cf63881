"""Correction of p-values for several tests at once."""

from __future__ import annotations

import numpy as np

from config.arrays import FloatArray


def holm(p_values: FloatArray) -> FloatArray:
    """Return p-values adjusted for testing several hypotheses at once (Holm 1979).

    Args:
        p_values: Shape (k,). P-value of each single hypothesis.
    """
    order = np.argsort(p_values)
    factors = len(p_values) - np.arange(len(p_values))
    adjusted = np.minimum(np.maximum.accumulate(p_values[order] * factors), 1.0)
    out = np.empty_like(p_values)
    out[order] = adjusted
    return out
