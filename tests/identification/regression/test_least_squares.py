from __future__ import annotations

import re

import numpy as np
import pytest
from numpy.typing import NDArray

from config.errors import EstimationError
from identification.regression.least_squares import Triangle, solve
from tests.builders.raised_codes import raises_code

NAMES = ("a", "b", "c")


@pytest.fixture
def equations() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    random = np.random.default_rng(0)
    matrix = random.normal(size=(200, 3))
    return matrix, matrix @ np.array([1.0, -2.0, 3.0]) + 0.1 * random.normal(size=200)


def test_blocks_give_the_same_result_as_all_rows_at_once(
    equations: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> None:
    matrix, rhs = equations
    triangle = Triangle.empty(3)
    for start in range(0, 200, 7):
        triangle = triangle.add(matrix[start : start + 7], rhs[start : start + 7])
    solution = solve([triangle], [1.0], NAMES)
    expected = np.asarray(np.linalg.lstsq(matrix, rhs, rcond=None)[0], dtype=np.float64)
    np.testing.assert_allclose(solution.values, expected, rtol=1e-12)
    np.testing.assert_allclose(solution.covariance, np.linalg.inv(matrix.T @ matrix), rtol=1e-10)
    assert solution.rows == 200
    assert triangle.residual_sum(expected) == pytest.approx(np.sum((rhs - matrix @ expected) ** 2))


def test_a_channel_is_weighted_by_the_inverse_of_its_noise() -> None:
    random = np.random.default_rng(1)
    matrix = random.normal(size=(2, 30, 3))
    rhs = random.normal(size=(2, 30))
    triangles = [Triangle.empty(3).add(m, r) for m, r in zip(matrix, rhs, strict=True)]
    solution = solve(triangles, [1.0, 10.0], NAMES)
    weight = np.array([1.0, 10.0])
    expected = np.linalg.lstsq(
        (matrix * weight[:, None, None]).reshape(-1, 3), (rhs * weight[:, None]).ravel(), rcond=None
    )[0]
    np.testing.assert_allclose(solution.values, expected, rtol=1e-12)


def test_digits_are_kept_that_normal_equations_lose() -> None:
    # Laeuchli's matrix: A^T A is exactly singular in double precision.
    small = 1e-9
    matrix = np.vstack([np.ones((1, 3)), small * np.eye(3)])
    truth = np.array([1.0, 2.0, 3.0])
    normal = matrix.T @ matrix
    assert np.linalg.matrix_rank(normal) == 1
    values = solve([Triangle.empty(3).add(matrix, matrix @ truth)], [1.0], NAMES).values
    np.testing.assert_allclose(values, truth, rtol=1e-5)


def test_the_condition_number_is_that_of_normalised_columns() -> None:
    matrix = np.eye(4)[:, :3] * np.array([1.0, 1e6, 1e-6])
    triangle = Triangle.empty(3).add(matrix, np.ones(4))
    assert solve([triangle], [1.0], NAMES).condition_number == pytest.approx(1.0)


def test_too_few_equations_are_refused() -> None:
    triangle = Triangle.empty(3).add(np.eye(3), np.ones(3))
    with raises_code(EstimationError, "RID-RECORDING-SHORT"):
        solve([triangle], [1.0], NAMES)


def test_a_parameter_without_effect_is_named() -> None:
    matrix = np.random.default_rng(0).normal(size=(9, 3)) * np.array([1.0, 0.0, 1.0])
    with raises_code(EstimationError, "RID-MOTION-UNINFORMATIVE"):
        solve([Triangle.empty(3).add(matrix, np.ones(9))], [1.0], NAMES)


def test_two_indistinguishable_parameters_are_named() -> None:
    matrix = np.random.default_rng(0).normal(size=(9, 3))
    matrix[:, 2] = 2.0 * matrix[:, 0]
    with raises_code(EstimationError, "RID-MOTION-UNINFORMATIVE") as caught:
        solve([Triangle.empty(3).add(matrix, np.ones(9))], [1.0], NAMES)
    assert re.search(r" (a, c|c, a)\b", str(caught.value))


def test_columns_without_effect_on_a_channel_can_be_omitted(equations) -> None:
    matrix, rhs = equations
    other = np.zeros((50, 3))
    other[:, 1] = np.linspace(1.0, 2.0, 50)
    whole = [Triangle.empty(3).add(matrix, rhs), Triangle.empty(3).add(other, np.ones(50))]
    narrow = Triangle.empty(3, np.array([1])).add(other[:, [1]], np.ones(50))
    expected = solve(whole, [1.0, 2.0], NAMES)
    solution = solve([whole[0], narrow], [1.0, 2.0], NAMES)
    np.testing.assert_allclose(solution.values, expected.values, rtol=1e-12)
    assert narrow.residual_sum(solution.values) == pytest.approx(
        whole[1].residual_sum(solution.values)
    )


def test_the_first_parameters_can_be_solved_for_alone(equations) -> None:
    matrix, rhs = equations
    solution = solve([Triangle.empty(3).add(matrix, rhs)], [1.0], NAMES)
    values, cost = solution.leading(2)
    expected, residual, *_ = np.linalg.lstsq(matrix[:, :2], rhs, rcond=None)
    np.testing.assert_allclose(values, expected, rtol=1e-10)
    assert cost == pytest.approx(residual[0])


def test_equations_that_are_not_finite_are_refused(equations) -> None:
    matrix, rhs = equations
    with raises_code(EstimationError, "RID-RECORDING-DAMAGED"):
        Triangle.empty(3).add(matrix, np.where(rhs > 0.0, np.nan, rhs))


def test_parameters_can_be_left_out_of_condensed_equations(equations) -> None:
    matrix, rhs = equations
    kept = np.arange(0, matrix.shape[1], 2)
    triangle = Triangle.empty(matrix.shape[1]).add(matrix, rhs).reduced(kept)
    found = solve([triangle], [1.0], tuple(map(str, kept)))
    np.testing.assert_allclose(found.values, np.linalg.lstsq(matrix[:, kept], rhs)[0], rtol=1e-9)
