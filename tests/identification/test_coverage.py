"""Intervals against model error: how often they hold the truth, on 60 simulated experiments."""

from __future__ import annotations

import pytest

from benchmarks.coverage import coverage


@pytest.mark.slow
def test_the_honest_interval_holds_the_truth_where_others_do_not() -> None:
    found = coverage(60)
    assert 0.90 <= found.clustered <= 0.98
    assert found.white < 0.85
    assert found.noise < 0.5
