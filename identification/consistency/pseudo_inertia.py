"""Pseudo-inertia of a body: the matrix that determines its physical consistency."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK

SIZE: Final = 4
SMALLEST_BODY: Final = (0.01, 0.0, 0.0, 0.0, 4e-7, 0.0, 0.0, 4e-7, 0.0, 4e-7)
"""Ten parameters of the lightest plausible body: a ball of 10 g and 1 cm radius."""


def _basis() -> FloatArray:
    """Return the pseudo-inertia per unit of each of the ten parameters, (10, 4, 4)."""
    basis = np.zeros((PARAMETERS_PER_LINK, SIZE, SIZE))
    basis[0, 3, 3] = 1.0
    for axis in range(3):
        basis[1 + axis, axis, 3] = basis[1 + axis, 3, axis] = 1.0
    for element, (row, column) in enumerate(zip(*np.triu_indices(3), strict=True)):
        inertia = np.zeros((3, 3))
        inertia[row, column] = inertia[column, row] = 1.0
        basis[4 + element, :3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    basis.setflags(write=False)
    return basis


BASIS: Final = _basis()


def pseudo_inertia(body: FloatArray) -> FloatArray:
    """Return the 4 x 4 matrix of density moments of a body (Wensing, Kim and Slotine 2018).

    A body of positive mass that is not flat exists if and only if this matrix is positive definite.

    Args:
        body: Shape (..., 10). Mass, first moment and inertia about the frame's origin, as in
            `RigidBodies`.

    Returns:
        Shape (..., 4, 4). Second moments of the mass about the origin [kg m^2], first moments [kg
        m], mass [kg].
    """
    return np.asarray(np.tensordot(body, BASIS, axes=1))
