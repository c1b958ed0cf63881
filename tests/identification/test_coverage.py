"""Coverage of intervals under model error, on 60 simulated experiments."""

from __future__ import annotations

import pytest

from benchmarks.coverage import coverage


@pytest.mark.slow
def test_only_the_jackknife_interval_covers_the_truth() -> None:
    found = coverage(60)
    assert 0.90 <= found.clustered <= 0.98
    assert found.white < 0.85
    assert found.noise < 0.5
