"""Derivatives of columns by the complex step, exact to rounding."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeAlias

import numpy as np

from config.arrays import FloatArray

STEP: Final = 1e-30

Values: TypeAlias = Any  # an array, complex if derivatives are computed


def slopes(columns: Callable[[Values], Values], x: FloatArray) -> FloatArray:
    """Return the derivative of functions that are analytic around each x.

    The complex step (Squire and Trapp 1998): f(x + i h) = f(x) + i h f'(x) + O(h^2), so for a
    tiny h the imaginary part over h is the derivative, without a difference.

    Args:
        columns: The functions, each applied element by element.
        x: The arguments.
    """
    return np.asarray(columns(x + 1j * STEP).imag / STEP)
