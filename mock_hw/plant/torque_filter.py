"""The anti-alias filter behind a simulated torque converter, as poles in time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.cell.cell import ButterworthFilter
from mock_hw.plant.butterworth import butterworth_poles

Vector = NDArray[np.float64]
ComplexVector = NDArray[np.complex128]


def filter_poles(
    torque_filter: ButterworthFilter | None,
) -> tuple[ComplexVector, ComplexVector, Vector]:
    """Return the filter's poles, residues and output weights, (p,); none without a filter."""
    if torque_filter is None:
        none = np.zeros(0, dtype=np.complex128)
        return none, none, np.zeros(0)
    return butterworth_poles(torque_filter.order, torque_filter.cutoff_hz)


def discretise(
    poles: ComplexVector, residues: ComplexVector, step_s: float
) -> NDArray[np.complex128]:
    """Return exp(p h), and the weights of the torque at a step's beginning and end, (3, p)."""
    growth = np.expm1(poles * step_s)
    level = growth / poles
    ramp = (growth - poles * step_s) / (poles * poles * step_s)
    gains = np.empty((3, len(poles)), dtype=np.complex128)
    gains[0] = growth + 1.0
    gains[1] = residues * (level - ramp)
    gains[2] = residues * ramp
    return gains
