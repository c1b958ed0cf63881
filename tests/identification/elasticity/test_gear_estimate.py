"""A stiffness that the data do not show is reported as such, with the reason."""

from __future__ import annotations

import numpy as np
import pytest

from identification.elasticity.gear_estimate import GearEstimate
from identification.elasticity.levenberg_marquardt import minimise
from identification.elasticity.link_motion import Gears


def estimate(sigma: float, bend_rad: float, residual: float) -> GearEstimate:
    one = np.ones(1)
    return GearEstimate(
        ("axis",),
        Gears(one, one, one, one),
        one,
        np.array([sigma]),
        one,
        np.array([bend_rad]),
        np.array([residual]),
        (),
        False,
    )


@pytest.mark.parametrize(
    ("sigma", "bend_rad", "residual", "number"),
    [(0.25, 1e-3, 0.1, "25 %"), (0.01, 1e-5, 0.1, "0.01 mrad"), (0.01, 1e-3, 0.6, "60 %")],
)
def test_an_axis_without_evidence_has_a_reason(
    sigma: float, bend_rad: float, residual: float, number: str
) -> None:
    (reason,) = estimate(sigma, bend_rad, residual).reasons
    assert reason is not None
    assert number in reason


def test_an_axis_with_evidence_has_none() -> None:
    assert estimate(0.05, 1e-4, 0.1).reasons == (None,)


def test_the_minimum_and_its_covariance_are_those_of_linear_least_squares() -> None:
    random = np.random.default_rng(0)
    matrix, wanted = random.normal(size=(30, 3)), random.normal(size=30)
    found = minimise(lambda x: matrix @ x - wanted, np.zeros(3), np.full(3, 1e-4), 20)
    assert found.x == pytest.approx(np.linalg.lstsq(matrix, wanted, rcond=None)[0], abs=1e-6)
    assert found.covariance == pytest.approx(np.linalg.inv(matrix.T @ matrix), rel=1e-6)
