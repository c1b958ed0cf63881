"""How commands that are sent once a cycle reach a drive's velocity loop."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.arrays import FloatArray

Complex = NDArray[np.complex128]


def interpolation_response(frequency_hz: FloatArray, cycle_time_s: float) -> Complex:
    """Return how commands that are sent once a cycle reach the velocity loop.

    What is sent in cycle k acts from SYNC k+1 on, and the drive goes to it linearly within that
    cycle: a triangle two cycles wide, two cycles late.

    Parameters
    ----------
    frequency_hz : ndarray, shape (lines,)
        Where.
    cycle_time_s : float
        The cycle [s].
    """
    late = np.exp(-2j * math.pi * frequency_hz * 2.0 * cycle_time_s)
    bent = np.sinc(frequency_hz * cycle_time_s) ** 2
    return np.asarray(bent * late, dtype=complex)
