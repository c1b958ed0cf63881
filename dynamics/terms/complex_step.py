"""Derivatives of functions by the complex step, exact except for rounding errors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeAlias

import numpy as np

from config.arrays import FloatArray

STEP: Final = 1e-30

Values: TypeAlias = Any  # array; complex to compute derivatives


def slopes(columns: Callable[[Values], Values], x: FloatArray) -> FloatArray:
    """Return the derivatives of functions at each x; the functions must be analytic there.

    The complex step (Squire and Trapp 1998) uses f(x + i h) = f(x) + i h f'(x) + O(h^2). For a tiny
    h, the imaginary part divided by h is the derivative. It needs no difference, so there is no
    cancellation.

    Args:
        columns: Function that returns the values of all functions, element by element.
        x: Arguments of the functions.
    """
    return np.asarray(columns(x + 1j * STEP).imag / STEP)
