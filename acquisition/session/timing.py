"""`CycleStatistics`: how well the cyclic task kept its time and its drives answered."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

LATENESS_EDGES_S = (0.0, 1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2)


@dataclass(frozen=True)
class CycleStatistics:
    """Counts and percentiles over the rows of one run.

    Attributes
    ----------
    cycles : int
        Cycles that were run.
    overruns : int
        Cycle times that passed without one.
    missed_frames : tuple of int, length joints
        Rows in which a drive's answer was missing or implausible.
    lateness_p50_s, lateness_p99_s, lateness_max_s : float
        How late cycles began after their deadline [s].
    lateness_edges_s, lateness_counts : tuple
        Histogram of the same; the last count is of everything beyond the last edge.
    exchange_p50_s, exchange_p99_s, exchange_max_s : float
        From SYNC to the last answer [s].
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
        """Return the fields as JSON has them."""
        return asdict(self)


def cycle_statistics(rows: NDArray[Any]) -> CycleStatistics:
    """Return the statistics of a run's rows.

    Parameters
    ----------
    rows : ndarray of `row_dtype`, shape (rows,)
        As `read_journal` gives them; may be empty.
    """
    lateness, exchange = rows["lateness_s"], rows["exchange_s"]
    edges = np.array([*LATENESS_EDGES_S, np.inf])
    overruns = int(np.sum(np.diff(rows["cycle"].astype(np.int64)) - 1)) if len(rows) else 0
    lateness_p50, lateness_p99, lateness_max = _percentiles(lateness)
    exchange_p50, exchange_p99, exchange_max = _percentiles(exchange)
    return CycleStatistics(
        cycles=len(rows),
        overruns=overruns,
        missed_frames=tuple(int(count) for count in np.sum(rows["valid"] == 0, axis=0)),
        lateness_p50_s=lateness_p50,
        lateness_p99_s=lateness_p99,
        lateness_max_s=lateness_max,
        lateness_edges_s=LATENESS_EDGES_S,
        lateness_counts=tuple(int(count) for count in np.histogram(lateness, edges)[0]),
        exchange_p50_s=exchange_p50,
        exchange_p99_s=exchange_p99,
        exchange_max_s=exchange_max,
    )


def _percentiles(values: NDArray[np.float64]) -> tuple[float, float, float]:
    if not len(values):
        return 0.0, 0.0, 0.0
    p50, p99, most = np.percentile(values, (50.0, 99.0, 100.0))
    return float(p50), float(p99), float(most)
