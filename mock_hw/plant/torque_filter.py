"""Butterworth low-pass filters as partial fractions, discretised exactly for any step.

They are used for the anti-alias filter of the simulated torque measurement and for the low-pass of
the simulated charge amplifier (`mock_hw.amplifier.analog`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.cell.torque_filter import ButterworthFilter

Vector = NDArray[np.float64]
ComplexVector = NDArray[np.complex128]


def butterworth_poles(order: int, cutoff_hz: float) -> tuple[ComplexVector, ComplexVector, Vector]:
    """Return poles, residues and output weights of a Butterworth filter, (p,) each.

    Of each complex pair of poles, only one is returned, with weight 2. The filter's output is the
    real part of the weighted sum.
    """
    angles = np.pi * (2 * np.arange(order) + order + 1) / (2 * order)
    unit: ComplexVector = np.exp(1j * angles)
    differences = unit[:, None] - unit[None, :] + np.eye(order)
    scale = 2.0 * np.pi * cutoff_hz
    residues: ComplexVector = scale / np.prod(differences, axis=1)
    kept = unit.imag > -1e-9
    weights = np.where(unit.imag > 1e-9, 2.0, 1.0)
    return scale * unit[kept], residues[kept], weights[kept]


def filter_poles(
    torque_filter: ButterworthFilter | None,
) -> tuple[ComplexVector, ComplexVector, Vector]:
    """Return poles, residues and output weights of a filter, (p,) each; empty for None."""
    if torque_filter is None:
        none = np.zeros(0, dtype=np.complex128)
        return none, none, np.zeros(0)
    return butterworth_poles(torque_filter.order, torque_filter.cutoff_hz)


def discretise(
    poles: ComplexVector, residues: ComplexVector, step_s: float
) -> NDArray[np.complex128]:
    """Return exp(pole * step), and the weights of the input at a step's start and end, (3, p)."""
    growth = np.expm1(poles * step_s)
    level = growth / poles
    ramp = (growth - poles * step_s) / (poles * poles * step_s)
    gains = np.empty((3, len(poles)), dtype=np.complex128)
    gains[0] = growth + 1.0
    gains[1] = residues * (level - ramp)
    gains[2] = residues * ramp
    return gains
