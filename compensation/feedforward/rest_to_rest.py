"""Motions from rest to rest on bins: made periodic by a slow return to where they begin."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray

REST_S: Final = 1.5
RETURN_S: Final = 1.5


def padding_rows(step_s: float) -> int:
    """Return the rows of the return, with a rest before and after it."""
    return round((2.0 * REST_S + RETURN_S) / step_s)


def returned(values: FloatArray, step_s: float) -> FloatArray:
    """Return a signal with a smooth way back to its first row, so that its bins have no jump.

    The return is far longer than a velocity loop's integral time: nothing of it is left when the
    motion begins.

    Parameters
    ----------
    values : ndarray, shape (samples, n)
        A signal that rests at both ends.
    step_s : float
        Time between rows [s].

    Returns
    -------
    ndarray, shape (samples + padding_rows, n)
    """
    rows = padding_rows(step_s)
    x = np.clip((np.arange(1, rows + 1) * step_s - REST_S) / RETURN_S, 0.0, 1.0)[:, np.newaxis]
    share = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    return np.concatenate([values, values[-1] + share * (values[0] - values[-1])])
