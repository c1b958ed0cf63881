"""Design criteria, compared with closed forms, singular values and central differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.design.criteria import Condition, Criterion, DOptimal, Goals

B = 5


def rows_of(seed: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    return random.normal(size=(30, B)) * 10.0 ** random.uniform(-0.7, 0.7, B)


CRITERIA: list[Criterion] = [
    DOptimal(),
    Condition(),
    Condition(np.array([1.0, 0.1, 3.0, 20.0, 1.0])),
    Goals(np.random.default_rng(9).normal(size=(3, B))),
]


@pytest.mark.parametrize("criterion", CRITERIA, ids=lambda each: type(each).__name__)
@settings(max_examples=20)
@given(seed=st.integers(0, 2**31))
def test_the_gradient_agrees_with_central_differences(criterion: Criterion, seed: int) -> None:
    rows = rows_of(seed)
    information = rows.T @ rows
    size = np.sqrt(np.diagonal(information))
    direction = np.random.default_rng(seed + 1).normal(size=(B, B)) * np.outer(size, size)
    direction += direction.T
    step = 1e-5
    values = [criterion.smooth(information + k * step * direction)[0] for k in (-2, -1, 1, 2)]
    expected = np.array([1.0, -8.0, 8.0, -1.0]) @ values / (12.0 * step)
    slope = float(np.sum(criterion.smooth(information)[1] * direction))
    assert slope == pytest.approx(expected, rel=1e-3, abs=1e-4)


@given(seed=st.integers(0, 2**31))
def test_d_optimality_is_the_log_determinant(seed: int) -> None:
    rows = rows_of(seed)
    expected = -np.linalg.slogdet(rows.T @ rows)[1] / B
    assert DOptimal().objective(rows.T @ rows) == pytest.approx(expected, rel=1e-6, abs=1e-6)


@given(seed=st.integers(0, 2**31))
def test_the_condition_number_is_the_ratio_of_singular_values(seed: int) -> None:
    rows = rows_of(seed)
    scaled = rows / np.linalg.norm(rows, axis=0)
    assert Condition().objective(rows.T @ rows) == pytest.approx(np.linalg.cond(scaled), rel=1e-6)
    plain = Condition(np.ones(B)).objective(scaled.T @ scaled)
    assert plain == pytest.approx(np.linalg.cond(scaled), rel=1e-6)


def test_scaled_columns_make_the_condition_number_independent_of_units() -> None:
    rows = rows_of(1)
    other_units = rows * np.array([1e3, 1.0, 1e-3, 57.3, 1.0])
    assert Condition().objective(rows.T @ rows) == pytest.approx(
        Condition().objective(other_units.T @ other_units)
    )


def test_goals_are_the_standard_deviations_of_an_estimate() -> None:
    rows = rows_of(2)
    covariance = np.linalg.inv(rows.T @ rows)
    one = Goals(np.eye(B)[[3]])
    assert np.exp(one.objective(rows.T @ rows)) == pytest.approx(np.sqrt(covariance[3, 3]))
    two = Goals(np.eye(B)[[1, 3]])
    product = covariance[1, 1] * covariance[3, 3]
    assert np.exp(4.0 * two.objective(rows.T @ rows)) == pytest.approx(product)


@pytest.mark.parametrize("criterion", CRITERIA, ids=lambda each: type(each).__name__)
def test_an_unidentifiable_parameter_has_a_bad_but_finite_criterion(criterion: Criterion) -> None:
    rows = rows_of(3)
    rows[:, 2] = 0.0
    objective, gradient = criterion.smooth(rows.T @ rows)
    full = rows_of(3)
    assert np.isfinite(objective)
    assert np.isfinite(gradient).all()
    assert objective > criterion.smooth(full.T @ full)[0]


@pytest.mark.parametrize(
    ("criterion", "words"),
    [
        (DOptimal(), "log determinant -1.5 (per parameter)"),
        (Condition(), "condition number 1.5"),
        (Goals(np.eye(2)), "mean log deviation 1.5"),
    ],
)
def test_a_criterion_value_has_a_description(criterion: Criterion, words: str) -> None:
    assert criterion.describe(1.5) == words
