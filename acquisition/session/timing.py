"""`CycleStatistics`: timing of the cyclic task, and missing answers of its drives."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from config.arrays import FloatArray, IntArray

LATENESS_EDGES_S = (0.0, 1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2)
MOST_VALUES = 1 << 16
_COARSE = ~np.int64((1 << 42) - 1)
"""Bit mask that keeps sign, exponent and ten bits of a double; it rounds values to 0.1 %."""


@dataclass(frozen=True)
class CycleStatistics:
    """Counts and percentiles over the rows of one run; percentiles are rounded by at most 0.1 %.

    Attributes:
        cycles: Number of cycles.
        overruns: Number of cycle times in which no cycle was executed.
        missed_frames: For each joint, number of rows in which its drive's answer was missing or
            implausible.
        lateness_p50_s, lateness_p99_s, lateness_max_s: Delay between deadline and start of a cycle
            [s].
        lateness_edges_s, lateness_counts: Histogram of this delay; the last count contains all
            values beyond the last edge.
        exchange_p50_s, exchange_p99_s, exchange_max_s: Time from SYNC to the last answer [s].
    """

    cycles: int
    overruns: int
    missed_frames: tuple[int, ...]
    lateness_p50_s: float
    lateness_p99_s: float
    lateness_max_s: float
    lateness_edges_s: tuple[float, ...]
    lateness_counts: tuple[int, ...]
    exchange_p50_s: float
    exchange_p99_s: float
    exchange_max_s: float

    def to_dict(self) -> dict[str, Any]:
        """Return the fields for JSON."""
        return asdict(self)


class CycleTally:
    """Accumulates the statistics of a run's rows in constant memory.

    Args:
        joints: Number of joints.
    """

    def __init__(self, joints: int) -> None:
        self._rows = self._overruns = 0
        self._last_cycle: int | None = None
        self._missed = np.zeros(joints, dtype=np.int64)
        self._edges = np.array([*LATENESS_EDGES_S, np.inf])
        self._counts = np.zeros(len(LATENESS_EDGES_S), dtype=np.int64)
        self._lateness, self._exchange = _CountedValues(), _CountedValues()

    def add(self, rows: NDArray[Any]) -> None:
        """Add rows to the statistics.

        Args:
            rows: Shape (rows,). Next rows of the run; may be empty.
        """
        if not len(rows):
            return
        cycle = rows["cycle"].astype(np.int64)
        before = cycle[0] - 1 if self._last_cycle is None else self._last_cycle
        self._overruns += int(cycle[-1] - before) - len(rows)
        self._last_cycle = int(cycle[-1])
        self._rows += len(rows)
        self._missed += np.sum(rows["valid"] == 0, axis=0)
        self._counts += np.histogram(rows["lateness_s"], self._edges)[0]
        self._lateness.add(rows["lateness_s"])
        self._exchange.add(rows["exchange_s"])

    def statistics(self) -> CycleStatistics:
        """Return the statistics of the rows so far."""
        lateness_p50, lateness_p99, lateness_max = map(self._lateness.quantile, (0.5, 0.99, 1.0))
        exchange_p50, exchange_p99, exchange_max = map(self._exchange.quantile, (0.5, 0.99, 1.0))
        return CycleStatistics(
            cycles=self._rows,
            overruns=self._overruns,
            missed_frames=tuple(self._missed.tolist()),
            lateness_p50_s=lateness_p50,
            lateness_p99_s=lateness_p99,
            lateness_max_s=lateness_max,
            lateness_edges_s=LATENESS_EDGES_S,
            lateness_counts=tuple(self._counts.tolist()),
            exchange_p50_s=exchange_p50,
            exchange_p99_s=exchange_p99,
            exchange_max_s=exchange_max,
        )


class _CountedValues:
    """Distinct values with their counts; rounded to 0.1 % once there are too many."""

    def __init__(self) -> None:
        self._values: FloatArray = np.empty(0)
        self._counts: IntArray = np.empty(0, dtype=np.int64)
        self._largest = -np.inf
        self._coarse = False

    def add(self, values: FloatArray) -> None:
        self._largest = max(self._largest, float(values.max()))
        self._merge(values, np.ones(len(values), dtype=np.int64))
        if len(self._values) > MOST_VALUES and not self._coarse:
            self._coarse = True
            self._merge(np.empty(0), np.empty(0, dtype=np.int64))

    def _merge(self, values: FloatArray, counts: IntArray) -> None:
        both = np.concatenate([self._values, values])
        if self._coarse:
            both = (both.view(np.int64) & _COARSE).view(np.float64)
        weights = np.concatenate([self._counts, counts])
        self._values, place = np.unique(both, return_inverse=True)
        self._counts = np.zeros(len(self._values), dtype=np.int64)
        np.add.at(self._counts, place, weights)

    def quantile(self, part: float) -> float:
        """Return a quantile as `numpy.quantile` does; 0 without values."""
        if not len(self._values):
            return 0.0
        if part == 1.0:
            return self._largest
        after = np.cumsum(self._counts)
        place = part * (int(after[-1]) - 1)
        ranks = [int(place), min(int(place) + 1, int(after[-1]) - 1)]
        low, high = self._values[np.searchsorted(after, ranks, side="right")]
        share = place - int(place)
        step = high - low
        return float(high - step * (1.0 - share) if share >= 0.5 else low + step * share)
