"""`AxisMechanics`: inertia and damping of one axis, fitted to its frequency response.

    velocity / torque = 1 / (J s + B)

at the pose of the multisine. J and B are apparent values; use them only for the stability margins
of the loops, for two reasons:
- Friction depends on the amplitude. B approximates it at this amplitude, and stiction acts like a
  spring against the inertia.
- The loops of the other joints are not rigid. Therefore J is smaller than the diagonal element of
  the mass matrix, by up to 17 % on the simulated arm. Noise alone causes 1.5 % there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import control
import numpy as np
from numpy.typing import NDArray

from compensation.loops.frequency_response import FrequencyResponse
from config.arrays import FloatArray, freeze
from config.errors import EstimationError

LEAST_RELATIVE: Final = 0.03
MEDIAN_OF_RAYLEIGH: Final = math.sqrt(math.log(2.0))
"""Ratio of the median magnitude of complex normal noise to its RMS."""


@dataclass(frozen=True, eq=False)
class AxisMechanics:
    """A fitted axis, joint side.

    Attributes:
        inertia: J [kg m^2 or kg].
        damping: B [N m s/rad or N s/m].
        covariance: Shape (2, 2). Covariance of J and B. The misfit is included as an error that all
            lines share. Use it for the margins only, not as a confidence interval of J.
        misfit: Median over the frequency lines of |1 - measured / fitted|, both torque per speed. A
            large value means that the axis is not a single inertia: usually it is elastic or stuck.
        noise: Value that `misfit` would have if noise between the periods were the only error.
    """

    joint_name: str
    inertia: float
    damping: float
    covariance: FloatArray
    misfit: float
    noise: float

    def __post_init__(self) -> None:
        freeze(self, EstimationError, (2, 2), "covariance")
        if not self.inertia > 0.0:
            raise EstimationError(
                f"joint {self.joint_name}: the velocity does not respond to torque like an inertia:"
                " increase the amplitude of the multisine or its band",
                code="RID-LOOP-WEAK",
            )

    @property
    def transfer_function(self) -> control.TransferFunction:
        """Velocity over torque as a python-control system."""
        return control.TransferFunction([1.0], [self.inertia, self.damping])

    def response(self, frequency_hz: FloatArray) -> NDArray[np.complex128]:
        """Return velocity over torque at frequencies [Hz]."""
        s = 2j * math.pi * np.asarray(frequency_hz, dtype=float)
        return np.asarray(self.transfer_function(s), dtype=np.complex128)

    def add(self, inertia: float, damping: float) -> AxisMechanics:
        """Return the axis with these amounts added to J and B; the inertia J stays positive."""
        return replace(
            self,
            inertia=max(self.inertia + inertia, 1e-3 * self.inertia),
            damping=self.damping + damping,
        )


def fit_axis_mechanics(measured: FrequencyResponse) -> AxisMechanics:
    """Fit inertia and damping to a response of `mechanics_responses`.

    Torque per speed is linear in inertia and damping, so weighted least squares on its real and
    imaginary parts suffices. Friction causes deviations that the noise variance does not contain.
    Therefore a relative error of 3 % is added to the noise of each line.

    Raises:
        EstimationError: The response is not that of an inertia.
    """
    omega = 2.0 * math.pi * measured.frequency_hz
    size = np.abs(measured.response)
    impedance = 1.0 / measured.response
    relative = np.sqrt(measured.variance) / size
    sigma = np.abs(impedance) * np.hypot(relative, LEAST_RELATIVE) / math.sqrt(2.0)
    rows = np.vstack(
        [
            np.column_stack([np.zeros_like(omega), 1.0 / sigma]),
            np.column_stack([omega / sigma, np.zeros_like(omega)]),
        ]
    )
    wanted = np.concatenate([impedance.real, impedance.imag]) / np.tile(sigma, 2)
    information = rows.T @ rows
    inertia, damping = np.linalg.solve(information, rows.T @ wanted)
    left = wanted - rows @ np.array([inertia, damping])
    freedom = max(1, len(left) - 2)
    fitted = 1j * omega * inertia + damping
    misfit = float(np.median(np.abs(impedance / fitted - 1.0)))
    covariance = np.linalg.inv(information) * max(1.0, float(left @ left) / freedom)
    covariance += np.diag([(misfit * inertia) ** 2, (misfit * damping) ** 2])
    return AxisMechanics(
        joint_name=measured.joint_name,
        inertia=float(inertia),
        damping=float(damping),
        covariance=np.asarray(covariance, dtype=float),
        misfit=misfit,
        noise=MEDIAN_OF_RAYLEIGH * float(np.median(np.sqrt(measured.variance_noise) / size)),
    )
