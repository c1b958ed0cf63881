"""Butterworth low-passes as partial fractions, which a step of any length discretises exactly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

ComplexVector = NDArray[np.complex128]
Vector = NDArray[np.float64]


def butterworth_poles(order: int, cutoff_hz: float) -> tuple[ComplexVector, ComplexVector, Vector]:
    """Return a filter's poles, residues and output weights, (p,).

    Of each complex pair one pole is kept, with weight 2: the output is the real part of the sum.
    """
    angles = np.pi * (2 * np.arange(order) + order + 1) / (2 * order)
    unit: ComplexVector = np.exp(1j * angles)
    differences = unit[:, None] - unit[None, :] + np.eye(order)
    scale = 2.0 * np.pi * cutoff_hz
    residues: ComplexVector = scale / np.prod(differences, axis=1)
    kept = unit.imag > -1e-9
    weights = np.where(unit.imag > 1e-9, 2.0, 1.0)
    return scale * unit[kept], residues[kept], weights[kept]
