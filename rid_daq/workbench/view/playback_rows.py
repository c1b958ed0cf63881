"""Choice of a motion's samples for playback, so that straight lines between them are accurate."""

from __future__ import annotations

import heapq
from itertools import pairwise

import numpy as np

from config.arrays import FloatArray, IntArray


def choose_rows(track: FloatArray, first_rows: IntArray, most_rows: int) -> IntArray:
    """Return the samples between which a motion is almost straight.

    The interval with the largest deviation is divided at that sample, until no deviation is greater
    than 1 or there are `most_rows` samples (Ramer, Douglas and Peucker).

    Args:
        track: Shape (samples, values). The motion, divided by the permitted deviations.
        first_rows: Shape (rows,). Ascending samples that are chosen in any case; with both ends.
        most_rows: Largest number of samples.
    """
    rows = set(first_rows.tolist())
    queue = [_interval(track, *ends) for ends in pairwise(first_rows.tolist())]
    heapq.heapify(queue)
    while queue and len(rows) < most_rows:
        deviation, first, row, last = heapq.heappop(queue)
        if -deviation <= 1.0:
            break
        rows.add(row)
        for ends in ((first, row), (row, last)):
            heapq.heappush(queue, _interval(track, *ends))
    return np.array(sorted(rows))


def largest_deviations(values: FloatArray, rows: IntArray) -> FloatArray:
    """Return the largest distance of each column from straight lines between rows, (columns,).

    Args:
        values: Shape (samples, columns).
        rows: Shape (rows,). Ascending samples at which the lines begin and end; with both ends.
    """
    samples = np.arange(len(values))
    lines = [np.interp(samples, rows, column[rows]) for column in values.T]
    return np.asarray(np.abs(values - np.column_stack(lines)).max(axis=0))


def _interval(track: FloatArray, first: int, last: int) -> tuple[float, int, int, int]:
    """Return the negative deviation of an interval, its first sample, the farthest, its last."""
    inner = track[first + 1 : last]
    if len(inner) == 0:
        return 0.0, first, first, last
    share = np.arange(1, last - first)[:, np.newaxis] / (last - first)
    line = track[first] + share * (track[last] - track[first])
    deviation = np.abs(inner - line).max(axis=1)
    farthest = int(deviation.argmax())
    return -float(deviation[farthest]), first, first + 1 + farthest, last
