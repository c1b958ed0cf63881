"""A stiffness that cannot be determined from the data is reported as such, with the reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config.arrays import FloatArray
from config.load import load_robot
from identification.elasticity.gear_estimate import GearEstimate, GearResponse
from identification.elasticity.levenberg_marquardt import minimise
from identification.elasticity.link_motion import Gears
from rid_daq.report.sections.gears import GearsSection


def estimate(
    *axes: tuple[float, float, float],
    minimum_hz: float = 10.0,
    damping_sigma: float = 0.1,
    unit: str = "rad",
) -> GearEstimate:
    """Return estimated gears.

    Each axis has a relative standard deviation, a deflection [rad or m] and a fraction of the
    residual.
    """
    sigma, bend, residual = np.array(axes).T
    one = np.ones(len(axes))
    lines = np.array([1.0, 20.0])
    response = GearResponse(lines, lines + 0j, lines + 0j)
    return GearEstimate(
        tuple(f"axis{number}" for number in range(1, len(axes) + 1)),
        (unit,) * len(axes),
        Gears(one, one, one, one),
        one,
        sigma,
        damping_sigma * one,
        bend,
        minimum_hz * one,
        residual,
        (response,) * len(axes),
        False,
    )


@pytest.mark.parametrize(
    ("sigma", "bend_rad", "residual", "number"),
    [(0.25, 1e-3, 0.1, "25 %"), (0.01, 1e-5, 0.1, "0.01 mrad"), (0.01, 1e-3, 0.6, "60 %")],
)
def test_an_axis_without_evidence_has_a_reason(
    sigma: float, bend_rad: float, residual: float, number: str
) -> None:
    (reason,) = estimate((sigma, bend_rad, residual)).reasons
    assert reason is not None
    assert number in reason


def test_an_axis_with_evidence_has_none() -> None:
    assert estimate((0.05, 1e-4, 0.12)).reasons == (None,)


def test_a_prismatic_gear_has_a_limit_of_its_own() -> None:
    assert estimate((0.05, 1e-5, 0.12), unit="m").reasons == (None,)
    (reason,) = estimate((0.05, 5e-6, 0.12), unit="m").reasons
    assert reason is not None
    assert "0.005 mm" in reason


def test_one_axis_that_is_not_explained_rejects_the_joint_fit() -> None:
    reasons = estimate((0.02, 1e-3, 0.10), (0.02, 1e-3, 0.18)).reasons
    assert all(reason is not None and "axis2" in reason for reason in reasons)


def test_an_instrument_that_contradicts_the_motors_rejects_the_joint_fit() -> None:
    found = replace(estimate((0.02, 1e-3, 0.1), (0.02, 1e-3, 0.1)), link_side_mismatch=0.9)
    assert all(reason is not None and "90 %" in reason for reason in found.reasons)


def test_a_resonance_above_the_last_line_is_not_shown() -> None:
    (reason,) = estimate((0.02, 1e-3, 0.1), minimum_hz=25.0).reasons
    assert reason is not None
    assert "25 Hz" in reason


@pytest.mark.parametrize(("sigma", "shown"), [(0.2, True), (0.9, False)])
def test_damping_is_left_out_if_the_data_do_not_show_it(sigma: float, shown: bool) -> None:
    found = estimate(*[(0.02, 1e-3, 0.1)] * 3, damping_sigma=sigma)
    section = GearsSection.of(load_robot("ir361"), found, ("run",))
    assert all((axis.damping is not None) == shown for axis in section.axes)
    assert all(("damping_nm_s" in keys) == shown for keys in section.keys.values())


def test_the_minimum_and_its_covariance_are_those_of_linear_least_squares() -> None:
    random = np.random.default_rng(0)
    matrix, wanted = random.normal(size=(30, 3)), random.normal(size=30)
    found = minimise(lambda x: matrix @ x - wanted, np.zeros(3), np.full(3, 1e-4), 20)
    assert found.x == pytest.approx(np.linalg.lstsq(matrix, wanted, rcond=None)[0], abs=1e-6)
    assert found.covariance == pytest.approx(np.linalg.inv(matrix.T @ matrix), rel=1e-6)


@pytest.mark.parametrize(("iterations", "is_settled"), [(1, False), (60, True)])
def test_a_minimum_that_was_not_reached_is_marked(iterations: int, is_settled: bool) -> None:
    def valley(x: FloatArray) -> FloatArray:
        return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0], 1.0])

    found = minimise(valley, np.array([-1.2, 1.0]), np.full(2, 1e-6), iterations)
    assert found.is_settled == is_settled
