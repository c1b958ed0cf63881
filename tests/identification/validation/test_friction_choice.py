"""Choice between friction terms that predict a joint equally well."""

from __future__ import annotations

import numpy as np
import pytest

from identification.equations.block_grams import PLAIN, Fit, Terms
from identification.equations.friction_columns import Column
from identification.validation.friction_choice import preferred_terms

BLOCKS = 12
SCATTER = 0.01 * np.resize([1.0, -1.0], BLOCKS)


def fit(terms: Terms, error: float, sigmas: float) -> Fit:
    """Return a solution of one joint whose added terms are `sigmas` away from zero."""
    places: dict[tuple[int, Column], int] = {}
    for term in (*PLAIN, *terms):
        places[0, term] = len(places)
    sigma = np.full(len(places), 0.1)
    errors = error * np.exp(len(terms) * SCATTER)
    return Fit(places, sigmas * sigma, sigma, errors[:, np.newaxis])


def trial(terms: Terms, error: float, sigmas: float) -> tuple[Terms, Fit]:
    return terms, fit(terms, error, sigmas)


NOW = fit((), 1.0, 9.0)
CUBIC = trial(("cubic",), 0.8, 3.0)


def test_of_equally_good_terms_the_one_distinct_from_zero_is_chosen() -> None:
    cube_root = trial(("cube_root",), 0.803, 4.5)
    assert preferred_terms([CUBIC, cube_root], NOW, 0) == ("cube_root",)


def test_a_term_that_predicts_clearly_worse_is_not_chosen() -> None:
    cube_root = trial(("cube_root",), 0.9, 4.5)
    assert preferred_terms([CUBIC, cube_root], NOW, 0) == ("cubic",)


@pytest.mark.parametrize("sigmas", [3.0, 4.5])
def test_of_equally_distinct_terms_the_one_with_the_smallest_error_is_chosen(sigmas: float) -> None:
    trials = [trial(("cube_root",), 0.803, sigmas), trial(("cubic",), 0.8, sigmas)]
    assert preferred_terms(trials, NOW, 0) == ("cubic",)


def test_more_terms_are_chosen_only_if_they_predict_clearly_better() -> None:
    both: Terms = ("cubic", "cube_root")
    assert preferred_terms([CUBIC, trial(both, 0.799, 5.0)], NOW, 0) == ("cubic",)
    assert preferred_terms([CUBIC, trial(both, 0.7, 5.0)], NOW, 0) == both
