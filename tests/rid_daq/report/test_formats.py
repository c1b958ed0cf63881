"""Formatted numbers: a value is rounded according to its interval."""

from __future__ import annotations

import math

import pytest

from rid_daq.blocks.formats import format_measured


@pytest.mark.parametrize(
    ("value", "reach", "shown"),
    [
        (9.60842, 0.1234, ("9.61", "0.12")),
        (1234.5, 341.0, ("1230", "340")),
        (0.0239051, 0.00123, ("0.0239", "0.0012")),
        (-0.2, 0.0043, ("−0.2000", "0.0043")),
        (1.234e-7, 1.2e-9, ("1.234·10⁻⁷", "0.012·10⁻⁷")),
        (1e7, 3e5, ("1.000·10⁷", "0.030·10⁷")),
        (-0.0001, 0.02, ("0.000", "0.020")),
        (0.5, 0.0996, ("0.50", "0.10")),
        (3.0, 1000.0, ("0", "1000")),
    ],
)
def test_a_value_is_rounded_according_to_its_interval(
    value: float, reach: float, shown: tuple[str, str]
) -> None:
    assert format_measured(value, reach) == shown


@pytest.mark.parametrize(
    ("value", "reach", "shown"),
    [
        (2.8051, 0.0, ("2.8051", "0")),
        (12.0, None, ("12", "–")),
        (None, 1.0, ("–", "1")),
        (1.5, math.inf, ("1.5", "not finite")),
        (math.nan, 0.1, ("not finite", "0.1")),
    ],
)
def test_a_value_without_an_interval_is_not_rounded(
    value: float | None, reach: float | None, shown: tuple[str, str]
) -> None:
    assert format_measured(value, reach) == shown
