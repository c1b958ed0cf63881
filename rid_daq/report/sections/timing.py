"""`Timing`: all of a result that differs from one execution to the next."""

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
"""How late cycles are by rounding of simulated time; no real loop wakes up as punctually."""

Counts = Annotated[tuple[int, ...], Strict(False)]


class LoopTiming(Section):
    """How well the cyclic task of a run kept its time.

    Attributes:
        role: What the run was for.
        sentence: All of it in a sentence.
        edges_us: Lower edges of the histogram of lateness [us].
        counts: Cycles a bin; the last bin holds everything beyond.
        cycles, overruns: Cycles that were run, and cycle times that passed without one.
        missed_frames: Rows without a drive's answer, one a joint.
        lateness_p50_s, lateness_p99_s, lateness_max_s: How late cycles began after their deadline
            [s].
        lateness_edges_s, lateness_counts: The histogram in seconds.
        exchange_p50_s, exchange_p99_s, exchange_max_s: From SYNC to the last answer [s].
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
    def told(self) -> bool:
        """Whether anything is known of how late cycles began: not in simulated time (lock-step)."""
        return self.lateness_max_s > ROUNDING_S

    @classmethod
    def of(cls, role: str, statistics: CycleStatistics) -> LoopTiming:
        """Return the loop's timing, with the histogram of how late its cycles began."""
        return cls(
            role=role,
            sentence=loop_sentence(statistics),
            edges_us=tuple(1e6 * edge for edge in statistics.lateness_edges_s),
            counts=statistics.lateness_counts,
            **asdict(statistics),
        )


class Timing(Section):
    """When a result was made, how long that took, and how well the cyclic tasks kept time.

    Attributes:
        elapsed_s: How long it took [s]; left out where nobody measured it.
        created_utc: When the run began, ISO 8601.
        run_ids: The runs that a result of several rests on; left out for one that was recorded.
        loops: One a motion that was driven; left out for an imported run.
        made: When each section was made, ISO 8601, by its name.
    """

    elapsed_s: float | None = None
    created_utc: str | None = None
    run_ids: Texts | None = None
    loops: tuple[LoopTiming, ...] | None = None
    made: dict[str, str] | None = None


def bin_names(edges_us: Sequence[float]) -> list[str]:
    """Return what the bins of a histogram are called: "10–20", "1–2 ms", "≥ 5 ms".

    Args:
        edges_us: The bins' lower edges [µs]; the last bin holds everything beyond.
    """
    return [
        f"{low:g}–{high:g}" if low < 1000.0 else f"{low / 1000.0:g}–{high / 1000.0:g} ms"
        for low, high in itertools.pairwise(edges_us)
    ] + [f"≥ {edges_us[-1] / 1000.0:g} ms"]


def loop_sentence(statistics: CycleStatistics) -> str:
    """Say how well the cyclic task kept its time."""
    missed = sum(statistics.missed_frames)
    if statistics.cycles and statistics.lateness_max_s <= ROUNDING_S:
        return (
            f"{statistics.cycles} cycles, {statistics.overruns} overruns, {missed} missed answers,"
            " in simulated time (lock-step): how late cycles begin on this computer is not told."
        )
    return (
        f"{statistics.cycles} cycles, {statistics.overruns} overruns, {missed} missed answers;"
        f" cycles began {_microseconds(statistics.lateness_p50_s)} late in the median,"
        f" {_microseconds(statistics.lateness_p99_s)} at 99 %,"
        f" {_microseconds(statistics.lateness_max_s)} at most; the drives had all answered"
        f" {_microseconds(statistics.exchange_p99_s)} after SYNC (99 %)."
    )


def _microseconds(seconds: float) -> str:
    return f"{1e6 * seconds:.0f} µs"
