"""The arm's weight in a payload verdict."""

from __future__ import annotations

import pytest

from identification.wiring.weight import ArmWeight
from rid_daq.operations.payload.payload_estimate import weight_checks

RANGE = (1 / 3, 3.0)


@pytest.mark.parametrize(
    ("share", "sigma", "reached", "relation", "passed"),
    [
        (0.9, 0.1, 1.1, "≥", True),
        (0.2, 0.05, 0.3, "≥", False),
        (1.2, 0.1, 1.0, "≤", True),
        (4.0, 0.25, 3.5, "≤", False),
        (-1.0, 0.1, -0.8, "≥", False),
    ],
)
def test_the_nearer_end_of_the_interval_is_compared_with_the_plausible_range(
    share: float, sigma: float, reached: float, relation: str, passed: bool
) -> None:
    (check,) = weight_checks(ArmWeight(share, sigma, RANGE, is_drawn=True))
    assert check.value == pytest.approx(reached)
    assert (check.relation, check.passed) == (relation, passed)


def test_an_interval_wider_than_the_plausible_range_is_no_check() -> None:
    assert weight_checks(ArmWeight(1.1, 1.02, RANGE, is_drawn=True)) == ()


def test_a_weight_that_is_only_known_from_the_arms_size_is_no_check() -> None:
    assert weight_checks(ArmWeight(4.0, 0.1, RANGE, is_drawn=False)) == ()
