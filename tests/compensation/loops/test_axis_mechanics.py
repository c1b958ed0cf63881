"""An axis as a single inertia: the residual of the fit is compared with the residual that noise
alone causes.
"""

from __future__ import annotations

import numpy as np
import pytest

from compensation.loops.axis_mechanics import AxisMechanics, fit_axis_mechanics
from compensation.loops.frequency_response import Distortion, FrequencyResponse

INERTIA, DAMPING = 8.0, 25.0
SHARE = 0.02
FREQUENCY_HZ = np.linspace(0.5, 20.0, 4000)


def fit_mechanics(resonance_hz: float | None = None) -> AxisMechanics:
    """Return the fit to a noisy response of an inertia (with a spring if `resonance_hz`)."""
    s = 2j * np.pi * FREQUENCY_HZ
    truth = 1.0 / (s * INERTIA + DAMPING)
    if resonance_hz is not None:
        truth = truth / (1.0 - (FREQUENCY_HZ / resonance_hz) ** 2 + 0.1j)
    random = np.random.default_rng(3)
    noise = random.normal(size=(2, len(s))) / np.sqrt(2.0)
    variance = (SHARE * np.abs(truth)) ** 2
    nothing = Distortion(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0))
    measured = FrequencyResponse(
        joint_name="axis1",
        frequency_hz=FREQUENCY_HZ,
        response=truth + np.sqrt(variance) * (noise[0] + 1j * noise[1]),
        variance_noise=variance,
        variance=variance,
        coherence=np.ones(len(s)),
        even=nothing,
        odd=nothing,
        realisations=2,
        periods=2,
    )
    return fit_axis_mechanics(measured)


def test_the_residual_of_a_rigid_axis_is_that_of_the_noise() -> None:
    axis = fit_mechanics()
    assert axis.inertia == pytest.approx(INERTIA, rel=1e-3)
    assert axis.misfit == pytest.approx(axis.noise, rel=0.05)


def test_the_residual_of_an_elastic_axis_is_far_larger() -> None:
    axis = fit_mechanics(resonance_hz=15.0)
    assert axis.misfit > 10.0 * axis.noise
