"""`PayloadBody`: a payload by mass, centre of gravity and inertia, and its reference frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.arrays import FloatArray, freeze
from config.errors import EstimationError
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.choices import REPORTED
from identification.consistency.pseudo_inertia import BASIS

PARAMETERS: Final = ("m", "sx", "sy", "sz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
"""The ten parameters of the torque's linear model (5.6); inertia about the flange's origin."""
REPORTED_UNITS: Final = ("kg", "m", "m", "m", *("kg m^2",) * 6)

_ELEMENTS: Final = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
_STEP: Final = 1e-30

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class PayloadBody:
    """A body about its centre of gravity, in the axes of the flange.

    Attributes:
        mass_kg: Mass of the body.
        centre_m: Shape (3,). Centre of gravity relative to the flange's origin.
        inertia_kg_m2: Shape (3, 3). Inertia about the centre of gravity, as elements of the matrix:
            Ixy = -integral of x y dm.
    """

    mass_kg: float
    centre_m: FloatArray
    inertia_kg_m2: FloatArray

    def __post_init__(self) -> None:
        freeze(self, EstimationError, (3,), "centre_m", what="payload ")
        freeze(self, EstimationError, (3, 3), "inertia_kg_m2", what="payload ")
        if not np.isfinite(self.mass_kg):
            raise EstimationError(
                "the mass of a payload must be a finite number", code="RID-API-ARGUMENT"
            )
        if np.max(np.abs(self.inertia_kg_m2 - self.inertia_kg_m2.T)) > 1e-9 * max(
            float(np.max(np.abs(self.inertia_kg_m2))), 1e-300
        ):
            raise EstimationError(
                "the inertia of a payload must be a symmetric matrix", code="RID-API-ARGUMENT"
            )

    @classmethod
    def of_reported(cls, values: FloatArray) -> PayloadBody:
        """Return the body whose ten reported quantities (`REPORTED`) are `values`."""
        inertia = np.zeros((3, 3))
        for (row, column), value in zip(_ELEMENTS, values[4:], strict=True):
            inertia[row, column] = inertia[column, row] = value
        return cls(float(values[0]), values[1:4], inertia)

    @classmethod
    def of_parameters(cls, parameters: FloatArray) -> PayloadBody:
        """Return the body of ten parameters (`PARAMETERS`) about the flange's origin."""
        return cls.of_reported(reported(parameters))

    @property
    def reported(self) -> FloatArray:
        """The ten values of `REPORTED`."""
        elements = [self.inertia_kg_m2[place] for place in _ELEMENTS]
        return np.array([self.mass_kg, *self.centre_m, *elements])

    @property
    def parameters(self) -> FloatArray:
        """The ten `PARAMETERS` about the flange's origin (parallel-axis theorem)."""
        mass, c = self.mass_kg, self.centre_m
        inertia = self.inertia_kg_m2 + mass * (c @ c * np.eye(3) - np.outer(c, c))
        return np.array([mass, *(mass * c), *inertia[np.triu_indices(3)]])

    @property
    def principal(self) -> tuple[FloatArray, FloatArray]:
        """The principal moments [kg m^2], shape (3,), and the rotation of their axes, (3, 3).

        The rotation's columns are the principal axes in the flange's frame, right-handed. Of the 24
        possible orders and directions of the axes, the one with the smallest rotation from the
        flange's axes is used. Therefore a body without products of inertia keeps its axes. The same
        rule selects the axes of equal moments.
        """
        moments, axes = np.linalg.eigh(self.inertia_kg_m2)
        return _least_rotated_axes(moments, axes)

    @property
    def is_consistent(self) -> bool:
        """True if the body is physically consistent (Traversaro 2016).

        Some distribution of positive mass must have these values.
        """
        moments = np.linalg.eigvalsh(self.inertia_kg_m2)
        return bool(
            self.mass_kg > 0.0 and moments[0] > 0.0 and moments[0] + moments[1] > moments[2]
        )


def reported(parameters: FloatArray | ComplexArray) -> FloatArray:
    """Return the ten values of `REPORTED` for ten `PARAMETERS`, which may be complex."""
    mass = parameters[0]
    c = parameters[1:4] / mass
    xx, xy, xz, yy, yz, zz = parameters[4:]
    square = mass * (c[0] * c[0] + c[1] * c[1] + c[2] * c[2])
    elements = (xx, yy, zz, xy, xz, yz)
    inertia = [
        value - (square if row == column else 0.0) + mass * c[row] * c[column]
        for (row, column), value in zip(_ELEMENTS, elements, strict=True)
    ]
    return np.array([mass, *c, *inertia])


def reported_slopes(parameters: FloatArray) -> FloatArray:
    """Return the derivative of `reported` by the ten parameters, (10, 10), by a complex step."""
    slopes = np.empty((len(REPORTED), PARAMETERS_PER_LINK))
    for column in range(PARAMETERS_PER_LINK):
        stepped = np.array(parameters, dtype=np.complex128)
        stepped[column] += 1j * _STEP
        slopes[:, column] = reported(stepped).imag / _STEP
    return slopes


def parameters_to_parent(pose: FloatArray) -> FloatArray:
    """Return the matrix that converts inertial parameters from a frame to its parent frame.

    Args:
        pose: Shape (4, 4). The frame in its parent frame.

    Returns:
        Shape (10, 10). A body's second and first moments and its mass, as one matrix, transform by
        H J H^T (`pseudo_inertia`), which is linear in its ten parameters.
    """
    matrix = np.empty((PARAMETERS_PER_LINK, PARAMETERS_PER_LINK))
    for column, element in enumerate(BASIS):
        moved = pose @ element @ pose.T
        second = moved[:3, :3]
        inertia = np.trace(second) * np.eye(3) - second
        matrix[:, column] = [moved[3, 3], *moved[:3, 3], *inertia[np.triu_indices(3)]]
    return matrix


def _least_rotated_axes(moments: FloatArray, axes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return moments and axes with the smallest rotation, as in `PayloadBody.principal`."""
    degenerate = 1e-9 * max(float(moments[2]), 1e-300)
    first, second = moments[1] - moments[0] < degenerate, moments[2] - moments[1] < degenerate
    if first and second:
        return moments, np.eye(3)
    if first or second:  # two moments are equal: only one axis is unique
        alone = 2 if first else 0
        unique = axes[:, alone]
        place = int(np.argmax(np.abs(unique)))
        target = np.eye(3)[place]
        unique = unique * np.sign(unique[place])
        named = np.full(3, moments[1])
        named[place] = moments[alone]
        return named, _smallest_rotation(target, unique)
    best, turn = np.eye(3), -np.inf
    named = moments
    for order in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        chosen = axes[:, order]
        signs = np.where(np.diagonal(chosen) < 0.0, -1.0, 1.0)
        pointed = chosen * signs
        if np.linalg.det(pointed) < 0.0:  # reverse the axis whose reversal adds the least rotation
            weakest = int(np.argmin(np.abs(np.diagonal(pointed))))
            pointed[:, weakest] *= -1.0
        trace = float(np.trace(pointed))
        if trace > turn + 1e-12:
            best, turn, named = pointed, trace, moments[list(order)]
    return named, best


def _smallest_rotation(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the smallest rotation between two unit vectors that are not opposite."""
    v = np.cross(start, end)
    cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1.0 + float(start @ end)))
