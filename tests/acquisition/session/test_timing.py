from __future__ import annotations

import json

import numpy as np
import pytest

from acquisition.journal.cycle_row import row_dtype
from acquisition.session.timing import LATENESS_EDGES_S, cycle_statistics


def test_counts_and_percentiles_are_those_of_the_rows() -> None:
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


def test_no_rows_are_no_trouble_and_all_of_it_is_json() -> None:
    statistics = cycle_statistics(np.zeros(0, dtype=row_dtype(3)))
    assert statistics.cycles == statistics.overruns == 0
    assert statistics.missed_frames == (0, 0, 0)
    assert json.loads(json.dumps(statistics.to_dict()))["lateness_max_s"] == 0.0
