"""Choice between friction terms that predict a joint equally well."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from config.load import load_robot
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from identification.equations.block_grams import PLAIN, Fit, Grams, Terms
from identification.equations.friction_columns import SPEEDS_RAD_S, THINNING_RAD_S, Column
from identification.validation.friction_choice import preferred_terms, remove_weak_terms
from identification.validation.robot_terms import with_speeds

BLOCKS = 12
SCATTER = 0.01 * np.resize([1.0, -1.0], BLOCKS)


def fit(terms: Terms, error: float, sigmas: float) -> Fit:
    """Return a solution of one joint; each term is `sigmas` standard deviations away from zero."""
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


THIN: Terms = ("coulomb", ("shear_thinning", 0.5))


@dataclass(frozen=True, eq=False)
class HiddenByLinks(Grams):
    """Two joints: a term of the first joint lowers only the error of the second joint.

    Attributes:
        sigmas: Estimate of the term divided by its standard deviation.
    """

    sigmas: float = 0.0

    def fit(self, chosen: Sequence[Terms]) -> Fit:
        sizes = {"load": self.sigmas, "offset": self.sigmas}
        places: dict[tuple[int, Column], int] = {}
        values: list[float] = []
        for j, own in enumerate(chosen):
            for term in own:
                places[j, term] = len(values)
                values.append(sizes.get(str(term), 9.0))
        errors = np.ones((BLOCKS, 2))
        errors[:, 1] = (0.8 if len(chosen[0]) > len(THIN) else 1.0) * np.exp(SCATTER)
        return Fit(places, np.array(values), np.ones(len(values)), errors)


def is_kept(term: FrictionTerm, sigmas: float, kept: FrictionTerm | None) -> bool:
    """Return True if a joint keeps its term in addition to the shear thinning of all joints."""
    grams = HiddenByLinks(
        np.zeros((2, BLOCKS, 1, 1)), np.ones((BLOCKS, 2)), np.arange(0), np.ones(2), sigmas
    )
    start: list[Terms] = [(*THIN, term), THIN]
    chosen, fit = remove_weak_terms(grams, start, grams.fit(start), kept)
    assert set(fit.places) == {(j, own) for j, terms in enumerate(chosen) for own in terms}
    return term in chosen[0]


def test_a_term_may_lower_the_error_of_other_joints_only_if_all_share_a_term() -> None:
    assert is_kept("load", 2.5, "shear_thinning")
    assert not is_kept("load", 2.5, None)


@pytest.mark.parametrize(
    ("term", "sigmas", "stays"),
    [
        ("load", 1.9, False),
        ("load", 2.1, True),
        ("load", -1.4, False),
        ("load", -6.0, False),
        ("offset", 1.9, False),
        ("offset", -1.9, False),
        ("offset", -2.1, True),
    ],
)
def test_the_error_of_other_joints_is_no_evidence_that_a_term_is_not_zero(
    term: FrictionTerm, sigmas: float, stays: bool
) -> None:
    """From nine seconds of data, an earlier version chose a negative load-dependent friction of 1.4
    sigma.
    """
    assert is_kept(term, sigmas, "shear_thinning") == stays


def test_a_robot_with_any_candidate_speed_can_be_read_again() -> None:
    slow = load_robot("ur10e")  # its base turns at 2.09 rad/s at most
    for speed in THINNING_RAD_S:
        thinning = with_speeds(slow, "shear_thinning", [speed] * len(slow.joints))
        assert RobotDescription.model_validate(thinning.model_dump()) == thinning
    for speed in SPEEDS_RAD_S:
        stribeck = with_speeds(slow, "stribeck", [speed] * len(slow.joints))
        assert RobotDescription.model_validate(stribeck.model_dump()) == stribeck
