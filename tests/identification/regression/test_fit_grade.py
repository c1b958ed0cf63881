from __future__ import annotations

import math

import numpy as np
import pytest

from identification.regression.fit_grade import Grade, grade_fit, limit_share, worst

JOINTS = ("shoulder", "elbow", "wrist")


def grade_of(residual: float, noise: float | None = None) -> Grade | None:
    (fit,) = grade_fit(
        ("joint",),
        np.array([residual]),
        np.array([100.0]),
        None if noise is None else np.array([noise]),
    )
    return fit.grade


@pytest.mark.parametrize(
    ("residual", "grade"),
    [(0.0, Grade.GOOD), (10.0, Grade.GOOD), (10.1, Grade.DOUBTFUL), (30.0, Grade.DOUBTFUL)],
)
def test_a_small_residual_is_not_bad(residual: float, grade: Grade) -> None:
    assert grade_of(residual) is grade


def test_more_than_a_third_of_the_torque_is_bad() -> None:
    assert grade_of(30.1) is Grade.BAD


def test_a_residual_at_the_noise_is_not_a_misfit() -> None:
    assert grade_of(50.0, noise=50.0) is Grade.GOOD
    assert grade_of(50.0, noise=45.0) is Grade.DOUBTFUL
    assert grade_of(50.0, noise=1.0) is Grade.BAD


def test_a_joint_at_rest_has_no_grade() -> None:
    fits = grade_fit(JOINTS, np.array([math.nan, 1.0, 1.0]), np.array([math.nan, 0.0, 20.0]))
    assert [fit.grade for fit in fits] == [None, None, Grade.GOOD]
    assert [fit.percent for fit in fits] == [None, None, 5.0]
    assert worst(fits) is Grade.GOOD


def test_the_worst_joint_decides() -> None:
    fits = grade_fit(JOINTS, np.array([1.0, 90.0, 15.0]), np.full(3, 100.0), np.full(3, 0.5))
    assert worst(fits) is Grade.BAD
    assert fits[1].over_noise == 180.0
    assert "90 % of the torque" in fits[1].reason


def test_noise_raises_the_limit_of_a_validation() -> None:
    limits = limit_share(np.array([10.0, 10.0]), np.array([0.0, 4.0]))
    np.testing.assert_allclose(limits, [0.3, 0.5])
