"""`Timing`: clock times, loop timing and run ids of a result."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Strict

from rid_daq.report.sections.section import Numbers, Section, Texts

if TYPE_CHECKING:
    from acquisition.session.timing import CycleStatistics

ROUNDING_S: Final = 1e-7
"""Largest lateness [s] that rounding of simulated time can cause; a real task is later."""

Counts = Annotated[tuple[int, ...], Strict(False)]


class LoopTiming(Section):
    """Timing of the cyclic task of a run.

    Attributes:
        role: Purpose of the run.
        sentence: Summary in a sentence.
        edges_us: Lower edges of the bins of the lateness histogram [us].
        counts: Number of cycles in each bin; the last bin has no upper edge.
        cycles: Number of cycles.
        overruns: Number of cycle times that passed without a cycle.
        missed_frames: Number of rows without an answer, for each joint's drive.
        lateness_p50_s: Median of the lateness [s]: time from a cycle's deadline to its start.
        lateness_p99_s: 99th percentile of the lateness [s].
        lateness_max_s: Largest lateness [s].
        lateness_edges_s: Lower edges of the lateness histogram [s].
        lateness_counts: Number of cycles in each bin of `lateness_edges_s`.
        exchange_p50_s: Median of the time from SYNC to the last drive's answer [s].
        exchange_p99_s: 99th percentile of the time from SYNC to the last answer [s].
        exchange_max_s: Largest time from SYNC to the last answer [s].
    """

    role: str
    sentence: str
    edges_us: Numbers
    counts: Counts
    cycles: int
    overruns: int
    missed_frames: Counts
    lateness_p50_s: float
    lateness_p99_s: float
    lateness_max_s: float
    lateness_edges_s: Numbers
    lateness_counts: Counts
    exchange_p50_s: float
    exchange_p99_s: float
    exchange_max_s: float

    @property
    def has_lateness(self) -> bool:
        """True if the lateness was measured; it is not measured in simulated time (lock-step)."""
        return self.lateness_max_s > ROUNDING_S

    @classmethod
    def of(cls, role: str, statistics: CycleStatistics) -> LoopTiming:
        """Return the timing of a run's cyclic task, with the histogram of its lateness."""
        return cls(
            role=role,
            sentence=loop_sentence(statistics),
            edges_us=tuple(1e6 * edge for edge in statistics.lateness_edges_s),
            counts=statistics.lateness_counts,
            **asdict(statistics),
        )


class Timing(Section):
    """Times, durations and loop timing of a result.

    Attributes:
        elapsed_s: Duration of the recording of a motion, with the start and the end of its
            processes, or of the whole demo [s]; left out if it was not measured.
        created_utc: Start of the run, ISO 8601; left out if the result has no such time.
        run_ids: The runs that the result is based on; left out for the result of one recorded run.
        loops: Timing of each motion that this result recorded; left out if it recorded none.
        made: Time at which each section was made, ISO 8601, by the section's name; left out if
            the result has no other section.
    """

    elapsed_s: float | None = None
    created_utc: str | None = None
    run_ids: Texts | None = None
    loops: tuple[LoopTiming, ...] | None = None
    made: dict[str, str] | None = None


def bin_names(edges_us: Sequence[float]) -> list[str]:
    """Return the names of the bins of a histogram: "10–20", "1–2 ms", "≥ 5 ms".

    Args:
        edges_us: Lower edges of the bins [µs]; the last bin has no upper edge.
    """
    return [
        f"{low:g}–{high:g}" if low < 1000.0 else f"{low / 1000.0:g}–{high / 1000.0:g} ms"
        for low, high in itertools.pairwise(edges_us)
    ] + [f"≥ {edges_us[-1] / 1000.0:g} ms"]


def loop_sentence(statistics: CycleStatistics) -> str:
    """Return a sentence on cycles, overruns, missed answers and lateness of a cyclic task."""
    missed = sum(statistics.missed_frames)
    if statistics.cycles and statistics.lateness_max_s <= ROUNDING_S:
        return (
            f"{statistics.cycles} cycles, {statistics.overruns} overruns, {missed} missed"
            " answers, in simulated time (lock-step), which has no lateness to measure."
        )
    return (
        f"{statistics.cycles} cycles, {statistics.overruns} overruns, {missed} missed answers;"
        f" cycles began {_microseconds(statistics.lateness_p50_s)} late in the median,"
        f" {_microseconds(statistics.lateness_p99_s)} at the 99th percentile,"
        f" {_microseconds(statistics.lateness_max_s)} at most; all drives had answered"
        f" {_microseconds(statistics.exchange_p99_s)} after SYNC (99th percentile)."
    )


def _microseconds(seconds: float) -> str:
    return f"{1e6 * seconds:.0f} µs"
