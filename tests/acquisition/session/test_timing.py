from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.journal.cycle_row import row_dtype
from acquisition.session.timing import LATENESS_EDGES_S, CycleStatistics, CycleTally


def cycle_statistics(rows: NDArray[Any], pieces: int = 1) -> CycleStatistics:
    tally = CycleTally(rows["valid"].shape[1])
    for piece in np.array_split(rows, pieces):
        tally.add(piece)
    return tally.statistics()


def test_counts_and_percentiles_match_the_rows() -> None:
    rows = np.zeros(100, dtype=row_dtype(2))
    rows["cycle"] = np.arange(100)
    rows["cycle"][60:] += 3
    rows["valid"] = 1
    rows["valid"][[3, 4, 9], 1] = 0
    rows["lateness_s"] = 15e-6
    rows["lateness_s"][50] = 0.5
    rows["exchange_s"] = 1e-3
    statistics = cycle_statistics(rows)
    assert (statistics.cycles, statistics.overruns) == (100, 3)
    assert statistics.missed_frames == (0, 3)
    assert statistics.lateness_p50_s == pytest.approx(15e-6)
    assert statistics.lateness_max_s == 0.5
    assert statistics.lateness_counts[1] == 99
    assert statistics.lateness_counts[-1] == 1
    assert len(statistics.lateness_counts) == len(LATENESS_EDGES_S)
    assert statistics.exchange_p99_s == pytest.approx(1e-3)


def test_statistics_of_no_rows_are_zero_and_serialisable_as_json() -> None:
    statistics = cycle_statistics(np.zeros(0, dtype=row_dtype(3)))
    assert statistics.cycles == statistics.overruns == 0
    assert statistics.missed_frames == (0, 0, 0)
    assert json.loads(json.dumps(statistics.to_dict()))["lateness_max_s"] == 0.0


def some_rows(count: int) -> NDArray[Any]:
    random = np.random.default_rng(3)
    rows = np.zeros(count, dtype=row_dtype(2))
    rows["cycle"] = np.cumsum(1 + (random.random(count) < 0.01))
    rows["valid"] = random.random((count, 2)) < 0.99
    rows["lateness_s"] = random.exponential(2e-5, count)
    rows["exchange_s"] = random.normal(1e-3, 1e-4, count)
    return rows


@pytest.mark.parametrize("count", [1, 2, 99, 1000, 20_000])
def test_statistics_of_pieces_equal_those_of_the_whole(count: int) -> None:
    rows = some_rows(count)
    statistics = cycle_statistics(rows, pieces=min(count, 7))
    assert statistics == cycle_statistics(rows)
    assert statistics.overruns == np.sum(np.diff(rows["cycle"].astype(int)) - 1)
    for name in ("lateness", "exchange"):
        found = [getattr(statistics, f"{name}_{each}_s") for each in ("p50", "p99", "max")]
        assert found == np.percentile(rows[f"{name}_s"], (50.0, 99.0, 100.0)).tolist()


def test_percentiles_of_very_many_rows_are_accurate_to_a_thousandth() -> None:
    rows = some_rows(200_000)
    statistics = cycle_statistics(rows, pieces=40)
    for name in ("lateness", "exchange"):
        p50, p99, most = np.percentile(rows[f"{name}_s"], (50.0, 99.0, 100.0))
        assert getattr(statistics, f"{name}_p50_s") == pytest.approx(p50, rel=1e-3)
        assert getattr(statistics, f"{name}_p99_s") == pytest.approx(p99, rel=1e-3)
        assert getattr(statistics, f"{name}_max_s") == most
